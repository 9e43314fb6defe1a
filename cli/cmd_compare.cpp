#include <fmt/format.h>

#include <cmath>
#include <iostream>

#include "cli/commands.h"
#include "core/error.h"
#include "core/outputs.h"
#include "film/exr_io.h"
#include "film/metrics.h"

namespace ambilux {
namespace {

struct CompareArguments {
    std::string image, reference, json;
};

/// Empty without such an attribute; files of other programs may have one of another kind.
std::string text_attribute(const Attributes& attributes, const std::string& name) {
    const auto at = attributes.find(name);
    return at != attributes.end() && at->is_string() ? at->get<std::string>() : "";
}

int compare(const CompareArguments& o) {
    const std::vector<Output> outputs = {{"--json", o.json}};
    check_outputs(outputs);
    check_not_inputs(outputs, {o.image, o.reference});
    Attributes attributes;
    const Image image = read_exr(o.image, &attributes);
    const Reference reference = read_reference_exr(o.reference);
    Metrics m;
    try {
        m = compare_images(image, reference);
    } catch (const Error& e) {
        throw input_error(o.image, 0, e.what());
    }
    nlohmann::json json = to_json(m);
    json["image"] = o.image;
    json["reference"] = o.reference;
    json["size"] = {image.width, image.height};
    json["spp"] = attributes.contains("spp") ? attributes["spp"] : nlohmann::json(nullptr);
    const std::string stated = text_attribute(attributes, "bias");
    json["stated_bias"] = stated;
    json["reference_spp"] = reference.samples ? nlohmann::json(reference.samples) : nlohmann::json(nullptr);
    if (!o.json.empty()) write_json(o.json, json);
    if (o.json == "-") return int(ExitCode::done);
    const bool known = !std::isnan(m.reference_noise);
    std::cout << fmt::format("RMSE    {:.6g}\n", m.rmse);
    if (known)
        std::cout << fmt::format("        {:.6g} without the reference's own noise of {:.3g}\n", m.rmse_corrected,
                                 m.reference_noise);
    else
        std::cout << "        holds the reference's own noise, which its file does not state\n";
    std::cout << fmt::format(
        "relMSE  {:.6g}\n        {:.6g} without the worst {} % of the pixels\nMAPE    {:.6g}\nbias    {:+.6g} ({:+.3f} "
        "% of the mean), z = {:+.2f}\n",
        m.relmse, m.relmse_trimmed, 100 * kTrimmedShare, m.mape, m.bias, 100 * m.relative_bias, m.bias_z);
    if (!stated.empty()) std::cout << fmt::format("        the image says: {}\n", stated);
    if (m.non_finite) std::cout << fmt::format("{} values of the image are NaN or Inf\n", m.non_finite);
    return int(ExitCode::done);
}

}  // namespace

void add_compare(CLI::App& app, Run& run) {
    auto o = std::make_shared<CompareArguments>();
    CLI::App& command =
        *app.add_subcommand("compare", "Error of an image against a reference: RMSE, relMSE, MAPE, bias");
    command.add_option("IMAGE", o->image, "Image (EXR)")->required();
    command.add_option("REF", o->reference, "Reference (EXR), of the same size")->required();
    command.add_option("--json", o->json, "Write the figures to a file, or - for standard output");
    command.callback([o, &run] { run = [o] { return compare(*o); }; });
}

}  // namespace ambilux
