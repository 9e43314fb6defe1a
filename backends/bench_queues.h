// What queues cost by themselves, so that compaction and ordering can be judged apart from rendering.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "scene/scene.h"

namespace ambilux {

/// Times operations on queues of `items` items (0: 4194304 on CUDA, 262144 on the CPU), each `repetitions` times after
/// 3 runs that do not count. First, for items of all sizes that renders push, with every compaction that renders use
/// for them:
///   push     that many threads look, and 1, 1/2, 1/4 or 1/16 of them, chosen by a hash, push an item that they make in
///   registers; compact  what a queue of fixed places needs before it is gone through: the list of its items (select),
///   or their number (none); drain    every item is loaded.
/// Then ordering, of the first hits of the scene's camera rays by material and of the rays that leave them by Morton
/// code. They come from a square film, of the least power of two pixels a side that has `items` pixels, but 2048 at
/// most; as many of them as there are, up to `items`. On CUDA none if there are fewer than 32768, which renders do not
/// sort:
///   keys     looked up or made for each item, 4 bytes;
///   sort     of places by such keys; of hits also by those of 2 bytes that they are kept with;
///   drain    in the order of the queue, and as sorted.
/// `backend`: cpu, cuda, or auto, which is cuda where there is a device and else cpu. The CPU has what its renders
/// have: a queue of 512 places for every thread, filled and drained in turns (`items` are rounded up to whole queues);
/// no compact, keys and sort, since its lists and orders are made as a part of drain. Its times are those of all
/// threads over the number of threads, and those of push include making the items. Result: backend, device, items,
/// repetitions, and rows of operation, item, bytes (of an item; keys, sort: of a key), compaction, order, share (of
/// threads that push), looked (threads or places that were looked at), items, ns_per_look, ns_per_item and gb_per_s,
/// from medians (CUDA events, or the clock of the threads). gb_per_s counts what has to be moved: items (push, drain),
/// flags and list (compact), keys (keys), keys and places twice (sort). What was drained is compared with what was
/// pushed, by number and sum, and sorted lists are looked through. Throws Error(usage) for another backend, no
/// repetitions or more than 2^28 items; Error(device) for cuda without a device, for want of memory, and if items do
/// not come back.
nlohmann::json bench_queues(const Scene& scene, const std::string& backend, uint32_t items, int repetitions);

}  // namespace ambilux
