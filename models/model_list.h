// Lists of models (BSDFs, emitters, ...): a model is a struct, its type the place in the list.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <tuple>
#include <type_traits>

#include "core/hd.h"

namespace ambilux {

/// A model as a value, for overloads and generic lambdas.
template <class Model>
struct ModelTag {
    using type = Model;
};

template <class... Models>
struct ModelList {
    static constexpr uint32_t count = sizeof...(Models), kAll = (1u << count) - 1;
    static_assert(count <= 16);  // cases of visit
    template <uint32_t I>
    using At = std::tuple_element_t<I, std::tuple<Models...>>;

    template <class Model>
    static constexpr uint32_t index() {
        static_assert((std::is_same_v<Model, Models> + ...) == 1, "not a model of this list, or in it twice");
        uint32_t i = 0;
        (void)((std::is_same_v<Model, Models> ? true : (++i, false)) || ...);
        return i;
    }

    /// A bit for every model of which `has(ModelTag<Model>)` is true.
    template <class Has>
    static constexpr uint32_t mask(Has has) {
        return (0u | ... | (uint32_t(has(ModelTag<Models>{})) << index<Models>()));
    }

    /// True if the mask has the model at `i`. Comparisons, as one would write them by hand.
    template <uint32_t Mask>
    AMBILUX_HD static constexpr bool contains(uint32_t i) {
        if constexpr (Mask == 0)
            return false;
        else
            return i == uint32_t(std::countr_zero(Mask)) || contains<Mask&(Mask - 1)>(i);
    }

    /// op(ModelTag<Model>) for every model.
    template <class Op>
    static constexpr void for_each(Op op) {
        (op(ModelTag<Models>{}), ...);
    }

    /// op(ModelTag<Model>) for the model at `i`, if that is one of those in the mask; `otherwise` if not. A switch as
    /// one would write it by hand: a chain of comparisons is inlined otherwise by nvcc, and kernels spill.
    template <uint32_t Mask, class Result, class Op>
    AMBILUX_HD static Result visit(uint32_t i, Result otherwise, Op op) {
#define AMBILUX_CASE(I)                                                            \
    case I:                                                                        \
        if constexpr ((Mask >> I & 1u) && I < count) return op(ModelTag<At<I>>{}); \
        break;
        switch (i) {
            AMBILUX_CASE(0)
            AMBILUX_CASE(1)
            AMBILUX_CASE(2)
            AMBILUX_CASE(3)
            AMBILUX_CASE(4)
            AMBILUX_CASE(5)
            AMBILUX_CASE(6)
            AMBILUX_CASE(7)
            AMBILUX_CASE(8)
            AMBILUX_CASE(9)
            AMBILUX_CASE(10)
            AMBILUX_CASE(11)
            AMBILUX_CASE(12)
            AMBILUX_CASE(13)
            AMBILUX_CASE(14)
            AMBILUX_CASE(15)
            default: break;
        }
#undef AMBILUX_CASE
        return otherwise;
    }
};

/// One of some structs, which of them is written elsewhere. Words, not a union: parts of it are then kept in registers,
/// and what no struct fills is zero.
template <class... Structs>
class OneOf {
public:
    template <class Struct>
    AMBILUX_HD Struct get() const {
        static_assert((std::is_same_v<Struct, Structs> || ...));
        Struct s;
        if constexpr (!std::is_empty_v<Struct>) memcpy(&s, words_, sizeof s);
        return s;
    }
    /// The same where it lies, for storage that is in memory anyway.
    template <class Struct>
    AMBILUX_HD const Struct& ref() const {
        static_assert((std::is_same_v<Struct, Structs> || ...));
        return reinterpret_cast<const Struct&>(words_);
    }
    template <class Struct>
    AMBILUX_HD void set(const Struct& s) {
        static_assert((std::is_same_v<Struct, Structs> || ...));
        static_assert(std::is_trivially_copyable_v<Struct> &&
                      (std::is_empty_v<Struct> || alignof(Struct) % sizeof(Word) == 0));
        if constexpr (!std::is_empty_v<Struct>) memcpy(words_, &s, sizeof s);
    }

private:
    using Word __attribute__((may_alias)) = uint32_t;

    alignas(Word) alignas(Structs...) Word words_[std::max({sizeof(Structs)...}) / 4] = {};
};

}  // namespace ambilux

// A list of models is a macro of lines X(Model, name): the struct, and the name in messages and files. Enumerators,
// names and types follow from it.
#define AMBILUX_MODEL_ENUMERATOR(Model, name) name,
#define AMBILUX_MODEL_NAME(Model, name) #name,
#define AMBILUX_MODEL_TYPE(Model, name) , Model

/// The enum of a list, with `count` behind it, and name_of for it.
#define AMBILUX_MODEL_ENUM(Enum, LIST)                                   \
    enum class Enum : uint32_t { LIST(AMBILUX_MODEL_ENUMERATOR) count }; \
    constexpr const char* name_of(Enum type) {                           \
        const char* names[] = {LIST(AMBILUX_MODEL_NAME)};                \
        return names[uint32_t(type)];                                    \
    }
