// libs: ambilux_formats ambilux_film JPEG::JPEG OpenEXR::OpenEXR
// timeout: 300
// Memory that runs out at any allocation: loading a scene and writing an image end by an exception, leak nothing, and
// work the next time.
#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <new>

#include "core/error.h"
#include "film/exr_io.h"
#include "film/png_io.h"
#include "formats/load.h"
#include "tests/support/catch.h"
#include "tests/support/image_files.h"
#include "tests/support/temp_folder.h"

namespace {

constexpr long kNever = -1;
std::atomic<long> left{kNever};  ///< allocations until one fails
std::atomic<size_t> least{0};    ///< bytes of an allocation that may fail
std::atomic<long> alive{0};

void* allocate(size_t size, size_t alignment) {
    for (long n = size < least ? kNever : left.load(); n != kNever;) {
        if (n == 0) return nullptr;  // and all that follow, as when memory is used up
        if (left.compare_exchange_weak(n, n - 1)) break;
    }
    void* p = nullptr;
    if (::posix_memalign(&p, std::max(alignment, sizeof(void*)), size) != 0) return nullptr;
    ++alive;
    return p;
}

void release(void* p) {
    if (p) --alive;
    std::free(p);
}

void* allocate_or_throw(size_t size, size_t alignment) {
    void* const p = allocate(size, alignment);
    if (!p) throw std::bad_alloc();
    return p;
}

}  // namespace

// All of a program's allocations by `new` go through these.
void* operator new(size_t size) { return allocate_or_throw(size, 0); }
void* operator new[](size_t size) { return allocate_or_throw(size, 0); }
void* operator new(size_t size, std::align_val_t a) { return allocate_or_throw(size, size_t(a)); }
void* operator new[](size_t size, std::align_val_t a) { return allocate_or_throw(size, size_t(a)); }
void* operator new(size_t size, const std::nothrow_t&) noexcept { return allocate(size, 0); }
void* operator new[](size_t size, const std::nothrow_t&) noexcept { return allocate(size, 0); }
void operator delete(void* p) noexcept { release(p); }
void operator delete[](void* p) noexcept { release(p); }
void operator delete(void* p, size_t) noexcept { release(p); }
void operator delete[](void* p, size_t) noexcept { release(p); }
void operator delete(void* p, std::align_val_t) noexcept { release(p); }
void operator delete[](void* p, std::align_val_t) noexcept { release(p); }
void operator delete(void* p, size_t, std::align_val_t) noexcept { release(p); }
void operator delete[](void* p, size_t, std::align_val_t) noexcept { release(p); }

using namespace ambilux;

namespace {

struct Count {
    long failures = 0;
    long leaked = 0;  ///< at most, after one failure
};

/// Runs `work` with a failure at its first allocation, its second one, and so on until it succeeds.
Count fail_everywhere(const std::function<void()>& work) {
    for (int i = 0; i < 3; ++i) work();  // what is made once for all
    Count count;
    for (long n = 0;; ++n) {
        const long before = alive;
        bool failed = false;
        left = n;
        try {
            work();
        } catch (const std::bad_alloc&) {
            failed = true;
        } catch (const Error&) {
            failed = true;  // OpenEXR turns those of its own into exceptions with a message
        }
        left = kNever;
        if (!failed) return count;
        ++count.failures;
        count.leaked = std::max(count.leaked, alive - before);
    }
}

}  // namespace

TEST_CASE("memory runs out at any allocation of loading a scene") {
    const test::TempFolder folder;
    folder.write("t.png", png_bytes(4, 4, std::vector<uint8_t>(48, 9)));
    folder.write("t.jpg", test::jpeg_file(8, 8, std::vector<uint8_t>(192, 9)));
    folder.write("e.hdr", test::hdr_header(2, 1) + test::rgbe(1, 1, 1) + test::rgbe(2, 1, 1));
    folder.write("m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n");
    folder.write("m.ply",
                 "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float "
                 "z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 "
                 "0\n3 0 1 2\n");
    const auto textured = [](const std::string& image) {
        return "<bsdf type='diffuse'><texture type='bitmap' name='reflectance'><string name='filename' value='" +
               image + "'/></texture></bsdf>";
    };
    const std::string path = folder.write(
        "s.xml",
        "<scene version='3.0.0'><default name='r' value='2'/><sensor type='perspective'/><shape type='obj'>"
        "<string name='filename' value='m.obj'/>" +
            textured("t.png") +
            "</shape><shape type='ply'><string "
            "name='filename' value='m.ply'/>" +
            textured("t.jpg") +
            "<emitter type='area'/></shape><shape "
            "type='sphere'><float name='radius' value='$r'/></shape><emitter type='envmap'><string name='filename' "
            "value='e.hdr'/></emitter></scene>");
    const Count count = fail_everywhere([&] { load_mitsuba(path); });
    CHECK(count.failures > 200);
    CHECK(count.leaked <= 0);
}

TEST_CASE("memory runs out at any allocation of writing and reading an image: the old file stays whole") {
    const test::TempFolder folder;
    const std::string exr = folder / "a.exr", png = folder / "a.png";
    const Image image{20, 10, std::vector<float>(600, 0.5f)};
    // Destructors of JSON values, which hold the attributes, allocate a little and must not throw: a library's choice.
    least = 256;
    const auto is_whole = [&] { return read_exr(exr).rgb == image.rgb; };
    struct Case {
        std::function<void()> work;
        long leaked;  ///< constructors of OpenEXR's files that fail leave a few objects behind
    };
    for (const Case& c : {Case{[&] { write_exr(exr, image, {{"spp", 3}}); }, 16},
                          Case{[&] { write_png(png, image); }, 0}, Case{[&] { read_exr(exr); }, 16}}) {
        const Count count = fail_everywhere(c.work);
        CHECK(count.failures >= 2);
        CHECK(count.leaked <= c.leaked);
        CHECK(is_whole());
        CHECK(folder.files() <= 2);
    }
    least = 0;
}
