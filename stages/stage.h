// What all stages share. A stage is a struct: where its items come from (items()), where its results go, the record of
// what it did, and operator()(i) for one item. Its type is its identity; kName is what statistics call it. It drops and
// counts what is no radiance.
#pragma once

#include "items/candidate_items.h"
#include "items/subpath_items.h"
#include "queues/reserved_queue.h"
#include "queues/stage_record.h"
#include "queues/wave.h"
#include "stages/counted.h"
#include "stages/fusion.h"
#include "stages/vertex_queues.h"
#include "transport/subpath/rules.h"
