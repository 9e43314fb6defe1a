// Numbers of a BSDF that textures set now and then: Constants of a record that has no such textures, else Slots, which
// SceneView::tables have and which are looked up wherever the BSDF is (transport/resolve_bsdf.h). A record without them
// costs no word and no more than a look at a sign.
//
// A model with slots has
// - Slots<Number>: the numbers, at most as many as a table's row of them is long;
// - with_slots(constants, numbers): the constants of a point;
// - Constants with specular_tint, which is a share, and with sheen_tint and flatness of 16 bits, in which a record with
//   slots says so and where they are.
#pragma once

#include "core/math.h"
#include "models/bsdf/model.h"

namespace ambilux {

template <class Model>
concept HasSlots = requires { typename Model::template Slots<float>; };

template <class Model>
constexpr uint32_t kSlotsOf = sizeof(typename Model::template Slots<float>) / sizeof(float);

/// Share of `of_one` in 1/65535.
AMBILUX_HD uint16_t share_of_65535(float of_one) { return uint16_t(clamp(of_one, 0.0f, 1.0f) * 65535.0f + 0.5f); }

/// True if textures set some of the numbers.
template <class Constants>
AMBILUX_HD bool in_slots(const Constants& c) {
    return c.specular_tint < 0.0f;
}
/// Where they are: value and texture of each, one word after the other.
template <class Constants>
AMBILUX_HD uint32_t slots_at(const Constants& c) {
    return uint32_t(c.sheen_tint) | uint32_t(c.flatness) << 16;
}
template <class Constants>
void set_slots_at(Constants& c, uint32_t at) {
    c.specular_tint = -1;
    c.sheen_tint = uint16_t(at);
    c.flatness = uint16_t(at >> 16);
}

/// Slots as an array.
template <class Number, class Slots>
Number* slot_array(Slots& slots) {
    static_assert(sizeof(Slots) % sizeof(Number) == 0);
    return reinterpret_cast<Number*>(&slots);
}

}  // namespace ambilux
