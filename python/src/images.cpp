// Images as arrays that NumPy sees without a copy, their files, and their comparison.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <cstring>
#include <optional>

#include "film/device_image.h"
#include "film/exr_io.h"
#include "film/metrics.h"
#include "film/png_io.h"
#include "python/src/bindings.h"

namespace nb = nanobind;
using namespace nb::literals;

namespace ambilux {
namespace {

using Pixels = nb::ndarray<nb::numpy, float, nb::ndim<3>>;
using PixelsIn = nb::ndarray<const float, nb::shape<-1, -1, 3>, nb::c_contig, nb::device::cpu>;

using DevicePixels = nb::ndarray<float, nb::ndim<3>, nb::c_contig, nb::device::cuda>;

/// A view of `image`, which `owner` keeps alive.
Pixels view(Image& image, nb::handle owner) {
    return Pixels(image.rgb.data(), {size_t(image.height), size_t(image.width), 3}, owner);
}

Image copied(const PixelsIn& pixels) {
    const float* const first = pixels.data();
    return {uint32_t(pixels.shape(1)), uint32_t(pixels.shape(0)), {first, first + pixels.size()}};
}

std::pair<Reference, std::string> read_image(const std::string& path) {
    Attributes attributes;
    Reference reference = read_reference_exr(path, &attributes);
    return {std::move(reference), json_text(attributes)};
}

void write_image(const std::string& path, const PixelsIn& rgb, std::optional<PixelsIn> standard_error, uint64_t samples,
                 const std::string& attributes, const std::vector<Layer>& layers) {
    const Attributes stated = nlohmann::json::parse(attributes);
    if (standard_error)
        write_reference_exr(path, {copied(rgb), copied(*standard_error), samples}, stated);
    else
        write_exr(path, copied(rgb), stated, layers);
}

std::string compare(const PixelsIn& image, const PixelsIn& mean, std::optional<PixelsIn> standard_error,
                    uint64_t samples) {
    Reference reference{copied(mean), {}, samples};
    if (standard_error) reference.standard_error = copied(*standard_error);
    return json_text(to_json(compare_images(copied(image), reference)));
}

}  // namespace

void bind_images(nb::module_& m) {
    nb::class_<Reference>(m, "Pixels", "Means of pixels and their standard errors.")
        .def_prop_ro(
            "rgb", [](nb::handle_t<Reference> self) { return view(nb::cast<Reference&>(self).mean, self); },
            nb::rv_policy::reference)
        .def_prop_ro(
            "stderr",
            [](nb::handle_t<Reference> self) -> std::optional<Pixels> {
                Image& image = nb::cast<Reference&>(self).standard_error;
                if (image.rgb.empty()) return std::nullopt;
                return view(image, self);
            },
            nb::rv_policy::reference)
        .def_ro("samples", &Reference::samples);
    nb::class_<Layer>(m, "Layer", "Values of pixels beside the image.")
        .def_ro("name", &Layer::name)
        .def_ro("channels", &Layer::channels)
        .def(
            "array",
            [](nb::handle_t<Layer> self, size_t height) {
                auto& layer = nb::cast<Layer&>(self);
                const size_t channels = layer.channels.size(), width = layer.values.size() / channels / height;
                return Pixels(layer.values.data(), {height, width, channels}, self);
            },
            nb::rv_policy::reference, "height"_a, "A view of height x width x channels.");
    nb::class_<DeviceImage>(m, "DeviceImage", "Means of pixels in the memory of a CUDA device.")
        .def_ro("device", &DeviceImage::device)
        .def_prop_ro("size", [](const DeviceImage& i) { return std::pair(i.width, i.height); })
        .def_prop_ro("pointer", [](const DeviceImage& i) { return reinterpret_cast<uintptr_t>(i.rgb.get()); })
        .def(
            "dlpack",
            [](nb::handle_t<DeviceImage> self) {
                const auto& i = nb::cast<const DeviceImage&>(self);
                return DevicePixels(i.rgb.get(), {size_t(i.height), size_t(i.width), 3}, self, {}, nb::dtype<float>(),
                                    nb::device::cuda::value, i.device);
            },
            nb::rv_policy::reference, nb::sig("def dlpack(self) -> object"),
            "A capsule of DLPack, which keeps the memory.");
    m.def("read_image", &read_image, "path"_a, "Pixels of an EXR file, and its attributes.");
    m.def("write_image", &write_image, "path"_a, "rgb"_a, "stderr"_a.none(), "samples"_a, "attributes"_a, "layers"_a,
          "Writes an EXR file: a reference if `stderr` is given, which has no layers.");
    m.def(
        "write_png",
        [](const std::string& path, const PixelsIn& rgb, float exposure) { write_png(path, copied(rgb), exposure); },
        "path"_a, "rgb"_a, "exposure"_a);
    m.def("compare", &compare, "image"_a, "mean"_a, "stderr"_a.none(), "samples"_a);
}

}  // namespace ambilux
