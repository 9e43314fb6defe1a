// Light of sky and sun by Hosek and Wilkie (2012, 2013), in RGB of W/(m² sr nm) as Mitsuba has it.
#pragma once

#include "core/vec.h"

namespace ambilux::document {

// By turbidity 1 to 10, ground albedo 0 and 1, control point over the sun's elevation, and channel (sky_data.cpp).
extern const double kSkyRadiance[10][2][6][3];
extern const double kSkyParameters[10][2][6][3][9];
// By turbidity, elevation from 2 to 88 degrees, channel (sun_data.cpp).
constexpr int kSunElevations = 30;
extern const double kSunIrradiance[10][kSunElevations][3];

class Sky {
public:
    /// `elevation` of the sun over the horizon in radians, turbidity in [1,10], `albedo` of the ground.
    Sky(double turbidity, Rgb albedo, double elevation);

    /// Radiance from a direction above the horizon: cosine with the zenith, angle to the sun.
    Rgb radiance(double cos_zenith, double angle) const;

private:
    double radiance_[3], parameters_[3][9];
};

/// On a surface that faces the sun, in W/(m² nm).
Rgb sun_irradiance(double turbidity, double elevation);

/// Angles of the sun in radians.
struct SunAngles {
    double zenith;
    double azimuth;  ///< from north to east
};
/// Position by date and place (Blanco-Muriel et al. 2001, "Computing the Solar Vector"); hours of local time, degrees,
/// `timezone` in hours.
struct SunTime {
    int year = 2010, month = 7, day = 10;
    double hour = 15, minute = 0, second = 0;
    double latitude = 35.6894, longitude = 139.6917, timezone = 9;
};
SunAngles sun_position(const SunTime& time);

}  // namespace ambilux::document
