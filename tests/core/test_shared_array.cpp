#include "core/shared_array.h"
#include "tests/support/catch.h"

using namespace ambilux;

TEST_CASE("copies share their memory until one of them changes") {
    SharedArray<int> a = {1, 2, 3};
    SharedArray<int> b = a;
    CHECK(same_array(a, b));
    b.push_back(4);
    CHECK_FALSE(same_array(a, b));
    CHECK(a == std::vector<int>{1, 2, 3});
    CHECK(b == std::vector<int>{1, 2, 3, 4});
    SharedArray<int> c = b;
    c.edit()[0] = 7;
    CHECK(b[0] == 1);
    CHECK(c[0] == 7);
    c.resize(2);
    CHECK(c == std::vector<int>{7, 2});
    const std::vector<int> more = {8, 9};
    c.insert(c.end(), more.begin(), more.end());
    CHECK(c == std::vector<int>{7, 2, 8, 9});
}

TEST_CASE("what is appended to an emptied copy and was there before takes no memory") {
    const SharedArray<int> a = {1, 2, 3, 4};
    SharedArray<int> b = a.emptied();
    CHECK(b.empty());
    const int same[] = {1, 2};
    b.append(same, 2);
    b.append(a.data() + 2, 2);
    CHECK(same_array(a, b));
    SharedArray<int> c = a.emptied();
    c.append(same, 2);
    const int other[] = {5, 6};
    c.append(other, 2);
    c.append(a.data(), 1);
    CHECK(c == std::vector<int>{1, 2, 5, 6, 1});
    CHECK(a == std::vector<int>{1, 2, 3, 4});
    // A part of the old one, and then values of its own.
    SharedArray<int> d = a.emptied();
    d.append(same, 1);
    CHECK(d.size() == 1);
    d.push_back(9);
    CHECK(d == std::vector<int>{1, 9});
    CHECK(a[1] == 2);
}

TEST_CASE("an array may append values of its own") {
    SharedArray<int> a = {1, 2, 3};
    for (int k = 0; k < 5; ++k) a.append(a.data(), a.size());
    CHECK(a.size() == 96);
    CHECK(a[95] == 3);
    CHECK(SharedArray<int>().data() == nullptr);
}
