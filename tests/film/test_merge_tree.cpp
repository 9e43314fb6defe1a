// libs: ambilux_film
// timeout: 60
// Sums of ranges: the same bits in whichever order films come, and however they were cut.
#include <algorithm>
#include <random>

#include "core/error.h"
#include "film/merge_tree.h"
#include "tests/support/catch.h"

using namespace ambilux;

namespace {

/// A film of one pixel; sums of three such values depend on their order.
FilmMoments film_of(uint64_t range) {
    std::mt19937_64 rng(range);
    FilmMoments film{1, 1, 1 + range % 3, std::vector<double>(3), std::vector<double>(3)};
    for (auto* values : {&film.sum, &film.sum_squares})
        for (double& value : *values) value = std::exponential_distribution<double>()(rng);
    return film;
}

/// The definition: a node is the sum of its halves; a half past the end is nothing.
FilmMoments defined(uint64_t first, uint64_t length, uint64_t count) {
    if (length == 1) return film_of(first);
    FilmMoments left = defined(first, length / 2, count);
    if (first + length / 2 < count) left.add(defined(first + length / 2, length / 2, count));
    return left;
}

bool same(const FilmMoments& a, const FilmMoments& b) {
    return a.samples == b.samples && a.sum == b.sum && a.sum_squares == b.sum_squares;
}

/// Ranges [0, count) cut into nodes at random.
std::vector<RangeNode> cut(uint64_t count, std::mt19937_64& rng) {
    std::vector<RangeNode> nodes;
    for (uint64_t at = 0; at < count;) {
        uint32_t level = uint32_t(rng() % 4);
        while (at % (1u << level) != 0 || at + (1u << level) > count) --level;
        nodes.push_back({level, at >> level});
        at += 1u << level;
    }
    return nodes;
}

FilmMoments node_film(RangeNode node) {
    MergeTree tree;
    for (uint64_t range = node.first(); range < node.end(); ++range) tree.add({0, range}, film_of(range));
    return tree.sum();
}

}  // namespace

TEST_CASE("the sum of a tree has the same bits in any order and for any nodes") {
    std::mt19937_64 rng(1);
    size_t otherwise = 0;
    for (const uint64_t count : {1, 2, 3, 5, 6, 7, 8, 11, 16, 31, 100, 128}) {
        CAPTURE(count);
        uint64_t length = 1;
        while (length < count) length *= 2;
        const FilmMoments expected = defined(0, length, count);
        for (int trial = 0; trial < 20; ++trial) {
            std::vector<RangeNode> nodes = cut(count, rng);
            std::shuffle(nodes.begin(), nodes.end(), rng);
            MergeTree tree;
            for (const RangeNode& node : nodes) {
                CHECK(!tree.has(node.first()));
                tree.add(node, node_film(node));
                CHECK(tree.has(node.end() - 1));
            }
            CHECK(same(tree.sum(), expected));
            CHECK(tree.entries().size() == size_t(__builtin_popcountll(count)));
            CHECK(same(tree.take_sum(), expected));
            CHECK(tree.entries().empty());
        }
        FilmMoments one_by_one;
        for (uint64_t range = 0; range < count; ++range) one_by_one.add(film_of(range));
        otherwise += !same(one_by_one, expected);
    }
    CHECK(otherwise > 0);  // the order matters, so the test can fail
}

TEST_CASE("ranges that are missing are told, and none is added twice") {
    MergeTree tree;
    CHECK(tree.next(0) == UINT64_MAX);
    tree.add({2, 1}, node_film({2, 1}));  // 4 to 8
    CHECK(tree.next(0) == 4);
    CHECK(tree.next(6) == 6);
    CHECK(tree.next(8) == UINT64_MAX);
    CHECK(!tree.has(3));
    CHECK(!tree.has(8));
    CHECK_THROWS_AS(tree.add({0, 5}, film_of(5)), Error);
    CHECK_THROWS_AS(tree.add({3, 0}, film_of(0)), Error);
    tree.add({0, 3}, film_of(3));
    CHECK(tree.entries().size() == 2);
}

TEST_CASE("few films are kept while ranges come nearly in their order") {
    MergeTree tree;
    size_t most = 0;
    for (uint64_t group = 0; group < 256; ++group)
        for (const uint64_t k : {3, 1, 0, 2}) {
            tree.add({0, 4 * group + k}, film_of(4 * group + k));
            most = std::max(most, tree.entries().size());
        }
    CHECK(most <= 8 + 3);
    CHECK(tree.entries().size() == 1);
}
