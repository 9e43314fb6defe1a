#include "formats/gltf/model.h"

#include <fmt/format.h>

#include <algorithm>
#include <climits>
#include <filesystem>

#include "core/text.h"
#include "formats/file_budget.h"
#include "formats/gltf/meshopt.h"

namespace ambilux::gltf {

void Context::fail(const std::string& message) const { document::fail(where, message); }

double Context::at_most_1(double value, const std::string& what) {
    if (value > double(document::kRoundedOne)) note(fmt::format("{} is {:.4g} and counts as 1", what, value));
    return std::min(value, 1.0);
}

void Context::leave_out(const std::string& extension, const std::string& what, const std::string& hint) {
    const auto& required = model.extensionsRequired;
    if (std::find(required.begin(), required.end(), extension) != required.end())
        return refuse(what + " is not supported" + hint, "it is left out");
    note(what + " is left out, which the file allows" + hint);
}

namespace {

struct Files {
    Context& context;
    std::string problem;
};

bool file_exists(const std::string& path, void*) {
    std::error_code ignored;
    return std::filesystem::is_regular_file(path, ignored);
}

std::string same_path(const std::string& path, void*) { return path; }

/// Within the limits; what is wrong is kept, since no exception may pass the library.
bool read_whole_file(std::vector<unsigned char>* out, std::string* error, const std::string& path, void* user) {
    Files& files = *static_cast<Files*>(user);
    try {
        const std::string bytes = read_input(path, files.context.document.limits);
        files.context.document.file_digests.push_back({path, sha256(bytes)});
        out->assign(bytes.begin(), bytes.end());
        return true;
    } catch (const std::exception& e) {
        files.problem = *error = e.what();
        return false;
    }
}

bool write_nothing(std::string*, const std::string&, const std::vector<unsigned char>&, void*) { return false; }

/// Keeps the bytes of a file or a data URI: our readers decode them when they are needed. Those of a buffer come
/// unchecked: image_views() takes them.
bool keep_image(tinygltf::Image* image, const int index, std::string*, std::string*, int, int,
                const unsigned char* bytes, int size, void* user) {
    auto& all = static_cast<Files*>(user)->context.image_bytes;
    if (image->bufferView >= 0) return true;
    if (index < 0 || size < 0) return false;
    if (all.size() <= size_t(index)) all.resize(size_t(index) + 1);
    all[size_t(index)].assign(reinterpret_cast<const char*>(bytes), size_t(size));
    return true;
}

void image_views(Context& context) {
    for (size_t i = 0; i < context.model.images.size(); ++i) {
        const int view = context.model.images[i].bufferView;
        if (view < 0) continue;
        const auto [bytes, size] = view_bytes(context, view, "image " + std::to_string(i));
        context.image_bytes[i].assign(bytes, bytes + size);
    }
}

/// Since version 2.9 tinygltf asks for sizes too.
template <class Callbacks>
Callbacks callbacks(Files& files) {
    Callbacks c;
    c.FileExists = file_exists;
    c.ExpandFilePath = same_path;
    c.ReadWholeFile = read_whole_file;
    c.WriteWholeFile = write_nothing;
    c.user_data = &files;
    if constexpr (requires { c.GetFileSizeInBytes; })
        c.GetFileSizeInBytes = [](size_t* size, std::string*, const std::string& name, void*) {
            std::error_code error;
            *size = std::filesystem::file_size(name, error);
            return !error;
        };
    return c;
}

}  // namespace

void read_model(Context& context, const std::string& path) {
    const std::string whole = read_input(path, context.document.limits);
    context.document.file_digests.push_back({path, sha256(whole)});
    const std::string bytes = with_fallback_buffers(whole.starts_with("glTF") ? whole : plain_text(path, whole));
    if (bytes.size() > size_t(INT32_MAX)) context.fail("a glTF file may have 2 GiB at most");
    Files files{context, ""};
    tinygltf::TinyGLTF reader;
    reader.SetFsCallbacks(callbacks<tinygltf::FsCallbacks>(files));
    reader.SetImageLoader(keep_image, &files);
    const std::string folder = std::filesystem::path(path).parent_path().string();
    std::string error, warning;
    bool read = false;
    try {
        read = bytes.starts_with("glTF")
                   ? reader.LoadBinaryFromMemory(&context.model, &error, &warning,
                                                 reinterpret_cast<const unsigned char*>(bytes.data()),
                                                 unsigned(bytes.size()), folder)
                   : reader.LoadASCIIFromString(&context.model, &error, &warning, bytes.data(), unsigned(bytes.size()),
                                                folder);
    } catch (const std::exception& e) {
        error = e.what();
    }
    if (!files.problem.empty()) context.fail(files.problem);
    std::replace(error.begin(), error.end(), '\n', ' ');
    constexpr size_t kLongest = 300;  // an error may quote a whole buffer
    if (error.size() > kLongest) error = error.substr(0, kLongest) + " ...";
    // Of these tinygltf leaves out the rest. Other errors are about what a file may lack, such as matrices of skins.
    const auto names = [&](const char* part) { return error.find(part) != std::string::npos; };
    if (!read || names("pbrMetallicRoughness") || names("TextureInfo"))
        context.fail("it is not valid glTF 2.0: " + (error.empty() ? "unknown reason" : error));
    if (!context.model.asset.version.starts_with("2"))
        context.fail("it is glTF " + context.model.asset.version + ", not 2.0");
    if (const std::string& least = context.model.asset.minVersion; !least.empty() && least != "2.0")
        context.fail("it asks for glTF " + least + ", which is not supported: 2.0 is");
    unpack_views(context);
    context.image_bytes.resize(context.model.images.size());
    image_views(context);
    check_names(context, json_part(bytes));
    if (!context.model.animations.empty()) context.note("animations are left out: nodes stand as they do without them");
}

const tinygltf::Value* extension(const tinygltf::ExtensionMap& extensions, const char* name) {
    const auto it = extensions.find(name);
    return it == extensions.end() || !it->second.IsObject() ? nullptr : &it->second;
}

int integer(const tinygltf::Value* object, const char* name, int fallback) {
    return int(std::clamp(number(object, name, fallback), -1.0, double(INT_MAX)));
}

double number(const tinygltf::Value* object, const char* name, double fallback) {
    if (!object || !object->Has(name) || !object->Get(name).IsNumber()) return fallback;
    return object->Get(name).GetNumberAsDouble();
}

}  // namespace ambilux::gltf
