// libs: ambilux_core
// The random number generator (core/rng.h) against published known answers.
#include "core/rng.h"

#include <array>

#include "tests/support/catch.h"

using namespace ambilux;

namespace {

using Words = std::array<uint32_t, 4>;

struct KnownAnswer {
    Uint4 counter;
    uint32_t key[2];
    Words rounds7, rounds10;
};

// Lines "philox4x32 7" and "philox4x32 10" of the file kat_vectors of Random123, the library of Salmon et al. 2011.
const KnownAnswer kKnownAnswers[] = {{{0, 0, 0, 0},
                                      {0, 0},
                                      {0x5f6fb709, 0x0d893f64, 0x4f121f81, 0x4f730a48},
                                      {0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}},
                                     {{0xffffffff, 0xffffffff, 0xffffffff, 0xffffffff},
                                      {0xffffffff, 0xffffffff},
                                      {0x5207ddc2, 0x45165e59, 0x4d8ee751, 0x8c52f662},
                                      {0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}},
                                     {{0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344},
                                      {0xa4093822, 0x299f31d0},
                                      {0x4dfccaba, 0x190a87f0, 0xc47362ba, 0xb6b5242a},
                                      {0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}}};

Words words(Uint4 v) { return {v.x, v.y, v.z, v.w}; }

}  // namespace

TEST_CASE("philox4x32 gives the published words after 7 and after 10 rounds") {
    for (const KnownAnswer& known : kKnownAnswers) {
        CHECK(words(philox4x32<7>(known.counter, known.key[0], known.key[1])) == known.rounds7);
        CHECK(words(philox4x32<10>(known.counter, known.key[0], known.key[1])) == known.rounds10);
    }
}

TEST_CASE("a block of a sequence is seven rounds of its key and place") {
    const KnownAnswer& known = kKnownAnswers[2];
    const RngKey key = {uint64_t(known.key[1]) << 32 | known.key[0], known.counter.x, known.counter.y,
                        Stream(known.counter.w)};
    CHECK(words(random_bits(key, known.counter.z)) == known.rounds7);
}
