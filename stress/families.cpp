#include "stress/families.h"

#include <iterator>

namespace ambilux::stress {

const std::vector<Family>& families() {
    static const std::vector<Family> list = [] {
        std::vector<Family> all;
        for (const auto make : {scale_families, mesh_families, view_families, light_families, direction_families,
                                opacity_families, material_families, depth_families, room_families, merging_families}) {
            std::vector<Family> some = make();
            std::move(some.begin(), some.end(), std::back_inserter(all));
        }
        return all;
    }();
    return list;
}

}  // namespace ambilux::stress
