// Memory on a CUDA device that frees itself, and CUDA's error codes as exceptions.
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/error.h"

namespace ambilux {

/// Throws Error(device) with `what`, the error's name and its text unless `error` is cudaSuccess. When memory ran out,
/// also the bytes that were asked for (if given) and those that are free.
inline void cuda_check(cudaError_t error, const char* what, uint64_t bytes_asked = 0) {
    if (error == cudaSuccess) return;
    std::string message = std::string(what) + ": " + cudaGetErrorName(error) + ", " + cudaGetErrorString(error);
    cudaGetLastError();  // the next call should report its own error
    if (error == cudaErrorMemoryAllocation) {
        size_t free = 0, total = 0;
        if (bytes_asked) message += "; " + std::to_string(bytes_asked) + " bytes asked for";
        if (cudaMemGetInfo(&free, &total) == cudaSuccess)
            message += "; " + std::to_string(free) + " of " + std::to_string(total) + " bytes free";
    }
    throw Error(ExitCode::device, message);
}

/// Bytes of the current device that nobody holds.
inline uint64_t free_device_bytes() {
    size_t free = 0, total = 0;
    cuda_check(cudaMemGetInfo(&free, &total), "device memory");
    return free;
}

/// Waits for what the default stream was given. Not for the device: another thread may capture a graph on it, which a
/// wait for the whole device breaks.
inline void wait_for_default_stream(const char* what) { cuda_check(cudaStreamSynchronize(nullptr), what); }

/// A copy to the device that has ended when this returns. By itself cudaMemcpy may return before its last bytes are
/// there, and streams that do not wait for the default one would overtake it.
inline void copy_and_wait(void* to, const void* from, uint64_t bytes, cudaMemcpyKind kind, const char* what) {
    if (bytes == 0) return;
    cuda_check(cudaMemcpy(to, from, bytes, kind), what);
    wait_for_default_stream(what);
}

/// An array on the device, not initialised. Without elements it holds no memory and data() is null. Copies run on the
/// default stream.
template <class T>
class DeviceBuffer {
    static_assert(std::is_trivially_copyable_v<T>);

public:
    DeviceBuffer() = default;
    /// `what` names the buffer in the message of a failure.
    explicit DeviceBuffer(size_t size, const char* what = "device memory") : size_(size) {
        if (size) cuda_check(cudaMalloc(reinterpret_cast<void**>(&data_), bytes()), what, bytes());
    }
    explicit DeviceBuffer(std::span<const T> values, const char* what = "device memory")
        : DeviceBuffer(values.size(), what) {
        upload(values);
    }
    ~DeviceBuffer() { cudaFree(data_); }
    DeviceBuffer(DeviceBuffer&& other) noexcept
        : data_(std::exchange(other.data_, nullptr)), size_(std::exchange(other.size_, 0)) {}
    DeviceBuffer& operator=(DeviceBuffer&& other) noexcept {
        std::swap(data_, other.data_);
        std::swap(size_, other.size_);
        return *this;
    }

    T* data() { return data_; }
    const T* data() const { return data_; }
    size_t size() const { return size_; }
    uint64_t bytes() const { return uint64_t(size_) * sizeof(T); }

    /// Copies from the host. Memory is allocated anew if the number of elements differs.
    void upload(std::span<const T> values) {
        if (values.size() != size_) {
            *this = DeviceBuffer();
            *this = DeviceBuffer(values.size());
        }
        copy_and_wait(data_, values.data(), bytes(), cudaMemcpyHostToDevice, "copy to the device");
    }
    /// Copies to the host, after the work on the default stream.
    std::vector<T> download() const {
        std::vector<T> values(size_);
        if (size_)
            cuda_check(cudaMemcpy(values.data(), data_, bytes(), cudaMemcpyDeviceToHost), "copy from the device");
        return values;
    }
    /// Sets all bytes to 0, in the order of `stream`.
    void zero(cudaStream_t stream = nullptr) {
        if (size_) cuda_check(cudaMemsetAsync(data_, 0, bytes(), stream), "clear device memory");
    }

private:
    T* data_ = nullptr;
    size_t size_ = 0;
};

/// Bytes of the current device that are zero at first (HostMemory has the same functions). All of them wait for the
/// device: waves run on a stream of their own.
class DeviceMemory {
public:
    DeviceMemory() = default;
    explicit DeviceMemory(uint64_t bytes, const char* what) : buffer_(bytes, what) { clear(data(), bytes); }

    std::byte* data() { return buffer_.data(); }
    uint64_t bytes() const { return buffer_.bytes(); }

    static void put(void* to, const void* from, uint64_t bytes) {
        copy_and_wait(to, from, bytes, cudaMemcpyHostToDevice, "copy to the device");
    }
    static void get(void* to, const void* from, uint64_t bytes) {
        if (bytes) cuda_check(cudaMemcpy(to, from, bytes, cudaMemcpyDeviceToHost), "copy from the device");
    }
    static void copy(void* to, const void* from, uint64_t bytes) {
        copy_and_wait(to, from, bytes, cudaMemcpyDeviceToDevice, "copy on the device");
    }
    static void clear(void* to, uint64_t bytes) {
        if (bytes == 0) return;
        cuda_check(cudaMemset(to, 0, bytes), "clear device memory");
        wait_for_default_stream("clear device memory");
    }

private:
    DeviceBuffer<std::byte> buffer_;
};

}  // namespace ambilux
