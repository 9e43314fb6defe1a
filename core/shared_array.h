// Arrays that copies share until one of them changes.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <initializer_list>
#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/huge_pages.h"

namespace ambilux {

/// A vector whose copies share their memory: one that is changed while others hold it gets memory of its own first.
/// Copies may be read and changed by different threads.
template <class T>
class SharedArray {
    static_assert(std::is_trivially_copyable_v<T>);

public:
    SharedArray() = default;
    SharedArray(std::vector<T> values)
        : size_(values.size()), all_(std::make_shared<std::vector<T>>(std::move(values))) {}
    SharedArray(std::initializer_list<T> values) : SharedArray(std::vector<T>(values)) {}
    template <class Iterator>
    SharedArray(Iterator first, Iterator last) : SharedArray(std::vector<T>(first, last)) {}

    size_t size() const { return size_; }
    bool empty() const { return size_ == 0; }
    const T* data() const { return all_ ? all_->data() : nullptr; }
    const T* begin() const { return data(); }
    const T* end() const { return data() + size_; }
    const T& operator[](size_t i) const { return data()[i]; }
    const T& back() const { return data()[size_ - 1]; }

    /// The values, to be changed.
    T* edit() { return own().data(); }
    void push_back(const T& value) {
        const T copy = value;
        own().push_back(copy);
        ++size_;
    }
    void reserve(size_t n) { own().reserve(n); }
    void resize(size_t n, const T& value = T{}) {
        own().resize(n, value);
        size_ = n;
    }
    void assign(size_t n, const T& value) { *this = SharedArray(std::vector<T>(n, value)); }
    void clear() { *this = SharedArray(); }
    template <class Iterator>
    void insert(const T* where, Iterator first, Iterator last) {
        const ptrdiff_t at = where - begin();
        std::vector<T>& all = own();
        all.insert(all.begin() + at, first, last);
        size_ = all.size();
    }
    void insert(const T* where, std::initializer_list<T> values) { insert(where, values.begin(), values.end()); }

    /// The same memory with nothing in it yet: what append() finds there again needs no memory of its own.
    SharedArray emptied() const {
        SharedArray out = *this;
        out.size_ = 0;
        return out;
    }
    /// Adds `count` values.
    void append(const T* values, size_t count) {
        if (all_ && all_->size() >= size_ + count) {
            const T* there = all_->data() + size_;
            if (there == values || count == 0 || memcmp(there, values, count * sizeof(T)) == 0) {
                size_ += count;
                return;
            }
        }
        const bool inside = all_ && values >= all_->data() && values < all_->data() + all_->size();
        const std::shared_ptr<std::vector<T>> held = inside ? all_ : nullptr;
        std::vector<T>& all = own();
        all.insert(all.end(), values, values + count);
        size_ = all.size();
    }
    bool operator==(const SharedArray& other) const { return std::equal(begin(), end(), other.begin(), other.end()); }
    bool operator==(const std::vector<T>& other) const {
        return std::equal(begin(), end(), other.begin(), other.end());
    }

private:
    std::vector<T>& own() {
        if (!all_)
            all_ = std::make_shared<std::vector<T>>();
        else if (all_.use_count() > 1 || all_->size() > size_) {
            // As large as what it departs from, which is what most changes lead to.
            auto copy = std::make_shared<std::vector<T>>();
            copy->reserve(all_->size());
            use_huge_pages(copy->data(), all_->size() * sizeof(T));
            copy->assign(all_->begin(), all_->begin() + ptrdiff_t(size_));
            all_ = std::move(copy);
        }
        return *all_;
    }

    size_t size_ = 0;
    std::shared_ptr<std::vector<T>> all_;
};

/// Whether both are the same values in the same place.
template <class T>
bool same_array(const SharedArray<T>& a, const SharedArray<T>& b) {
    return a.size() == b.size() && a.data() == b.data();
}

}  // namespace ambilux
