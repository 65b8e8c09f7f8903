// Geographic coordinates: converts between the systems that a geoSystem field names and geocentric metres.
//
// Geocentric: x towards latitude 0, longitude 0; z to the north pole. All numbers are double. Latitudes and longitudes
// are in degrees, heights in metres above the ellipsoid (geoids are not supported). Errors: geodetic both ways 2e-8 m,
// UTM both ways below 1e-8 m within a zone and 1e-6 m as far as 30 degrees from its middle. Threading: values. Source:
// ISO/IEC 19775-1 V4.0 25.2; Karney, Transverse Mercator with an accuracy of a few nanometers, J. Geodesy 85 (2011),
// the sixth order of Krueger's series; Bowring, Survey Review 23 (1976), iterated.
#pragma once

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/value.h>

namespace rtsg {

/// An ellipsoid of revolution; lengths are in metres.
struct Ellipsoid {
    double equatorialRadius = 6378137, inverseFlattening = 298.257223563;
    double flattening() const { return 1 / inverseFlattening; }
};

struct GeoSystem {
    enum class Kind : std::uint8_t {
        geodetic,    // latitude, longitude, height
        utm,         // northing, easting, height
        geocentric,  // x, y, z
    } kind = Kind::geodetic;
    Ellipsoid ellipsoid;
    bool isSwapped = false;  // longitude_first, easting_first
    int zone = 0;            // of UTM: 1 to 60
    bool isSouthern = false;

    /// Reads a geoSystem field (25.2.3). Errors: a word that the standard does not know; UTM without a zone.
    static Result<GeoSystem> read(const Array<String>& words);

    /// Converts to geocentric metres.
    Vec3d toGeocentric(const Vec3d& coordinates) const;
    /// Converts from geocentric metres; longitudes are from -180 to 180.
    Vec3d fromGeocentric(const Vec3d& point) const;
    /// East, up and south at a geocentric point, as columns; up is the ellipsoid's normal. At a pole, longitude 0 is
    /// used; at the Earth's centre the axes are the Earth's.
    glm::dmat3 frameAt(const Vec3d& geocentric) const;
};

}  // namespace rtsg
