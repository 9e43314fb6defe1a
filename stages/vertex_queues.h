// Queues of vertices: only those lanes are moved that hold something.
#pragma once

#include "items/vertex_items.h"
#include "queues/queue.h"

namespace ambilux {

/// Vertices of light subpaths, kept over a wave.
template <class Mis>
using LightVertices = Queue<ConnectionVertex<Mis>>;

template <Features F, class Item>
AMBILUX_HD uint32_t push_vertex(const Queue<Item>& vertices, const Item& item) {
    return vertices.push(item, lanes_of<F>(item));
}

template <Features F, class Item>
AMBILUX_HD Item load_vertex(const Queue<Item>& vertices, uint32_t i) {
    Item item = vertices.items.load(i, Item::kDiffuseLanes);
    if constexpr (Item::template lanes<F>() > Item::kDiffuseLanes)
        if (!item.bits().template diffuse<F>())
            vertices.items.load_more(i, item, Item::kDiffuseLanes, Item::template lanes<F>());
    return item;
}

}  // namespace ambilux
