// Records of single precision into the same records of double precision, field by field.
#pragma once

#include <array>
#include <cstddef>
#include <tuple>
#include <type_traits>
#include <utility>

namespace ambilux::twin {
namespace detail {

/// Initialises a field of any type.
struct AnyField {
    template <class T>
    operator T() const;
};

template <size_t>
using AnyFieldAt = AnyField;
template <class T, size_t... I>
constexpr bool has_fields(std::index_sequence<I...>) {
    return requires { T{AnyFieldAt<I>{}...}; };
}

/// Fields of an aggregate without bases and without arrays.
template <class T, size_t kMost = 24>
constexpr size_t field_count() {
    if constexpr (kMost == 0 || has_fields<T>(std::make_index_sequence<kMost>()))
        return kMost;
    else
        return field_count<T, kMost - 1>();
}

/// References to the fields. A count that is not the record's does not compile.
template <class T>
auto fields(T& r) {
    constexpr size_t kCount = field_count<std::remove_const_t<T>>();
    static_assert(kCount >= 1 && kCount <= 18, "a longer record needs a line here");
#define AMBILUX_FIELDS(count, ...)    \
    if constexpr (kCount == count) {  \
        auto& [__VA_ARGS__] = r;      \
        return std::tie(__VA_ARGS__); \
    }
    AMBILUX_FIELDS(1, a)
    AMBILUX_FIELDS(2, a, b)
    AMBILUX_FIELDS(3, a, b, c)
    AMBILUX_FIELDS(4, a, b, c, d)
    AMBILUX_FIELDS(5, a, b, c, d, e)
    AMBILUX_FIELDS(6, a, b, c, d, e, f)
    AMBILUX_FIELDS(7, a, b, c, d, e, f, g)
    AMBILUX_FIELDS(8, a, b, c, d, e, f, g, h)
    AMBILUX_FIELDS(9, a, b, c, d, e, f, g, h, i)
    AMBILUX_FIELDS(10, a, b, c, d, e, f, g, h, i, j)
    AMBILUX_FIELDS(11, a, b, c, d, e, f, g, h, i, j, k)
    AMBILUX_FIELDS(12, a, b, c, d, e, f, g, h, i, j, k, l)
    AMBILUX_FIELDS(13, a, b, c, d, e, f, g, h, i, j, k, l, m)
    AMBILUX_FIELDS(14, a, b, c, d, e, f, g, h, i, j, k, l, m, n)
    AMBILUX_FIELDS(15, a, b, c, d, e, f, g, h, i, j, k, l, m, n, o)
    AMBILUX_FIELDS(16, a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p)
    AMBILUX_FIELDS(17, a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q)
    AMBILUX_FIELDS(18, a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, s)
#undef AMBILUX_FIELDS
}

}  // namespace detail

/// Sets `to` to what `from` is: numbers and enumerators to their values, arrays and records element by element. Records
/// that hold arrays or have bases have overloads of their own (twin/scene.cpp).
template <class From, class To>
void convert(const From& from, To& to) {
    if constexpr (std::is_arithmetic_v<From> || std::is_enum_v<From>) {
        to = static_cast<To>(from);
    } else if constexpr (std::is_array_v<From>) {
        static_assert(std::extent_v<From> == std::extent_v<To>);
        for (size_t i = 0; i < std::extent_v<From>; ++i) convert(from[i], to[i]);
    } else if constexpr (!std::is_empty_v<From> && sizeof(From) > 0) {
        const auto a = detail::fields(from);
        auto b = detail::fields(to);
        static_assert(std::tuple_size_v<decltype(a)> == std::tuple_size_v<decltype(b)>);
        [&]<size_t... I>(std::index_sequence<I...>) {
            (convert(std::get<I>(a), std::get<I>(b)), ...);
        }(std::make_index_sequence<std::tuple_size_v<decltype(a)>>());
    }
}

}  // namespace ambilux::twin
