// A layer of an image file beside the image itself.
#pragma once

#include <string>
#include <vector>

namespace ambilux {

/// Row-major from the top left: width * height * channels.size() values.
struct Layer {
    std::string name;
    std::vector<std::string> channels;  ///< "R", "G", "B" of the layer "albedo" are albedo.R and so on in the file
    std::vector<float> values;
};

}  // namespace ambilux
