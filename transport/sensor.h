// Sensors: film positions by the reconstruction filter, camera rays, and the importance side for bidirectional methods.
#pragma once

#include "transport/sensor/camera.h"
#include "transport/sensor/filter.h"
#include "transport/sensor/importance.h"
#include "transport/sensor/latlong.h"
