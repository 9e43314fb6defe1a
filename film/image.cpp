#include "film/image.h"

#include "core/error.h"

namespace ambilux {

Image mean_image(const FilmMoments& moments) {
    Image image{moments.width, moments.height, std::vector<float>(moments.sum.size())};
    for (size_t i = 0; i < image.rgb.size(); ++i) image.rgb[i] = float(moments.mean(i));
    return image;
}

Reference to_reference(const FilmMoments& moments) {
    Reference r{
        mean_image(moments), {moments.width, moments.height, std::vector<float>(moments.sum.size())}, moments.samples};
    for (size_t i = 0; i < r.standard_error.rgb.size(); ++i) r.standard_error.rgb[i] = float(moments.standard_error(i));
    return r;
}

FilmMoments to_moments(const Reference& reference) {
    if (reference.samples < 2 || reference.standard_error.rgb.size() != reference.mean.rgb.size())
        throw Error(ExitCode::bad_input, "an image without standard errors or sample count cannot be continued");
    const double n = double(reference.samples);
    const size_t size = reference.mean.rgb.size();
    FilmMoments m{reference.mean.width, reference.mean.height, reference.samples, std::vector<double>(size),
                  std::vector<double>(size)};
    for (size_t i = 0; i < size; ++i) {
        const double mean = reference.mean.rgb[i], se = reference.standard_error.rgb[i];
        m.sum[i] = mean * n;
        m.sum_squares[i] = se * se * n * (n - 1) + n * mean * mean;
    }
    return m;
}

}  // namespace ambilux
