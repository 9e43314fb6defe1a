// A cell of the stress sweep: a generated scene, the parameter that makes it hard, and the answer.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "film/image.h"

namespace ambilux::stress {

/// A file beside a scene: text, or an image that is written as OpenEXR.
struct Asset {
    std::string name, text;
    Image image = {};
};

/// A scene in Mitsuba's XML, format 3.0.0, and what it refers to.
struct SceneFiles {
    std::string xml;
    std::vector<Asset> assets = {};
};

enum class AnswerKind {
    closed_form,  ///< a formula, or an integral of one variable or two in double precision
    invariance,   ///< `value` times the mean of the benign cell of the family, by the same method
};

/// What the mean over all pixels and channels of a cell must be.
struct Answer {
    AnswerKind kind = AnswerKind::closed_form;
    double value = 0;      ///< radiance; of an invariance the factor
    bool uniform = false;  ///< every pixel has this value, not their mean alone
    std::string source;    ///< the formula in one line
    /// Differences up to this share of the answer are put down to rounding: a path of 20 vertices multiplies some
    /// hundred floats of 6e-8 each. More where the scene's own numbers, as floats, say another angle.
    double rounding = 2e-5;
};

struct Cell {
    std::string family;
    std::string label;  ///< of the parameter's value, in names of files: "1e-06"
    double value = 0;   ///< of the parameter
    Answer answer;
    std::function<SceneFiles()> scene;  ///< made when it is needed: some are large
    bool benign = false;                ///< the others of the family are compared with it; the first of its family
    bool quick = false;                 ///< part of --quick
    std::string limit = {};             ///< heading in docs/numerics.md that says why the image may be wrong
    /// Methods (prefixes of names, separated by blanks) that find the light too rarely to say anything: an image that
    /// is black is then too noisy to judge. Of all others it is wrong.
    std::string rare = {};
    std::string only = {};         ///< prefixes of names of methods that it is for; empty: all
    std::string not_mitsuba = {};  ///< why Mitsuba 3 cannot load the scene, or takes it for another
    double effort = 1;             ///< of the usual number of first samples, and of all those of --quick
    std::vector<std::pair<std::string, std::string>> settings = {};  ///< over those of the method
    uint64_t samples = 0;                                            ///< of every pixel that must be rendered
    bool device_only = false;                                        ///< takes a host minutes for each method

    std::string name() const { return family + "_" + label; }
};

/// A family: cells that differ by one parameter.
struct Family {
    std::string name, parameter;  ///< parameter: what is swept, with its unit
    std::vector<Cell> cells;
};

}  // namespace ambilux::stress
