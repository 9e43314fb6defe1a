// libs: ambilux_render ambilux_integrators ambilux_film ambilux_formats ambilux_accel ambilux_core
// labels: long
// timeout: 3600
// The published images by blocks of 16 x 16 pixels: enough samples that the noise of a block does not decide.
#include "tests/support/published_image.h"

using namespace ambilux;

TEST_CASE("cornell-box agrees with its published image, block by block") {
    require_published_image("cornell-box", 65, 96, 16);
}
TEST_CASE("veach-mis agrees with its published image, block by block") {
    require_published_image("veach-mis", 2, 64, 16);
}
