// Geographic systems against closed forms: meridian arcs by quadrature, conformality, and round trips over the globe.
#include <cmath>

#include <gtest/gtest.h>

#include <rtsg/core/geo_system.h>

namespace rtsg {

namespace {

GeoSystem systemOf(std::initializer_list<const char*> words) {
    Array<String> list;
    for (const char* word : words) list.push_back(String(word));
    auto system = GeoSystem::read(list);
    EXPECT_TRUE(system) << (system ? "" : system.error().text);
    return system.value_or(GeoSystem{});
}
std::string errorOf(std::initializer_list<const char*> words) {
    Array<String> list;
    for (const char* word : words) list.push_back(String(word));
    const auto system = GeoSystem::read(list);
    return system ? "" : system.error().text;
}

/// The length of the meridian from the equator, by Simpson's rule in long double.
long double meridian(const Ellipsoid& e, long double latitude) {
    const long double f = 1 / static_cast<long double>(e.inverseFlattening), e2 = f * (2 - f);
    const int steps = 20000;
    const long double h = latitude / steps;
    const auto speed = [&](long double phi) {
        const long double s = std::sin(phi);
        return e.equatorialRadius * (1 - e2) / std::pow(1 - e2 * s * s, 1.5L);
    };
    long double sum = speed(0) + speed(latitude);
    for (int i = 1; i < steps; ++i) sum += (i % 2 ? 4 : 2) * speed(h * i);
    return sum * h / 3;
}

constexpr long double kRadian = 3.14159265358979323846264338327950288L / 180;

}  // namespace

TEST(GeoSystem, GeodeticPointsLieOnTheEllipsoid) {
    const GeoSystem gd = systemOf({"GD", "WE"});
    EXPECT_EQ(gd.toGeocentric({0, 0, 0}), Vec3d(6378137, 0, 0));
    EXPECT_NEAR(gd.toGeocentric({90, 0, 0}).z, 6378137 * (1 - 1 / 298.257223563), 1e-9);
    EXPECT_NEAR(gd.toGeocentric({0, 90, 1000}).y, 6379137, 1e-9);
    const double a = 6378137, b = a * (1 - 1 / 298.257223563);
    for (double latitude = -85; latitude < 90; latitude += 7.5) {
        const Vec3d ground = gd.toGeocentric({latitude, 33, 0}), above = gd.toGeocentric({latitude, 33, 1234});
        EXPECT_NEAR((ground.x * ground.x + ground.y * ground.y) / (a * a) + ground.z * ground.z / (b * b), 1, 1e-15);
        // Up is the gradient of the ellipsoid's equation, and the height counts along it.
        const Vec3d up = glm::normalize(Vec3d(ground.x / (a * a), ground.y / (a * a), ground.z / (b * b)));
        EXPECT_NEAR(glm::length(above - (ground + up * 1234.0)), 0, 2e-9) << latitude;
        EXPECT_NEAR(glm::length(gd.frameAt(above)[1] - up), 0, 1e-14) << latitude;
    }
}

TEST(GeoSystem, GeodeticRoundTripsOverTheGlobe) {
    for (const char* ellipsoid : {"WE", "CC", "KA"}) {
        const GeoSystem gd = systemOf({"GD", ellipsoid});
        for (double latitude = -90; latitude <= 90; latitude += 3.75)
            for (double longitude = -179.5; longitude < 180; longitude += 17)
                for (const double height : {-10000., 0., 8848., 400e3, 36e6}) {
                    const Vec3d back = gd.fromGeocentric(gd.toGeocentric({latitude, longitude, height}));
                    EXPECT_NEAR(back.x, latitude, 1e-12);
                    if (std::abs(latitude) < 90) {
                        EXPECT_NEAR(back.y, longitude, 1e-12);
                    }
                    EXPECT_NEAR(back.z, height, 2e-8);
                }
    }
}

TEST(GeoSystem, LocalFramesAreEastUpSouth) {
    const GeoSystem gd = systemOf({"GD"});
    for (double latitude = -80; latitude <= 80; latitude += 20)
        for (double longitude = -170; longitude < 180; longitude += 40) {
            const Vec3d here = gd.toGeocentric({latitude, longitude, 0});
            const glm::dmat3 frame = gd.frameAt(here);
            const double step = 1e-5;
            const Vec3d east = glm::normalize(gd.toGeocentric({latitude, longitude + step, 0}) - here);
            const Vec3d south = glm::normalize(gd.toGeocentric({latitude - step, longitude, 0}) - here);
            EXPECT_NEAR(glm::length(frame[0] - east), 0, 1e-6);
            EXPECT_NEAR(glm::length(frame[2] - south), 0, 1e-6);
            EXPECT_NEAR(glm::determinant(frame), 1, 1e-14);
        }
    EXPECT_EQ(gd.frameAt({0, 0, 0}), glm::dmat3(1));
    EXPECT_NEAR(gd.frameAt({0, 0, 6356752})[1].z, 1, 1e-15);
}

// A conformal map is known by its values on one line: here northings along the zone's middle, which are lengths of the
// meridian.
TEST(GeoSystem, UtmNorthingsInTheMiddleAreArcsOfTheMeridian) {
    for (const char* ellipsoid : {"WE", "CD", "IN"}) {
        const GeoSystem utm = systemOf({"UTM", "Z32", ellipsoid}), gd = systemOf({"GD", ellipsoid});
        for (double latitude = -84; latitude <= 84; latitude += 10.5) {
            const Vec3d at = utm.fromGeocentric(gd.toGeocentric({latitude, 9, 0}));
            const long double arc = meridian(gd.ellipsoid, static_cast<long double>(latitude) * kRadian) * .9996L;
            EXPECT_NEAR(at.x, static_cast<double>(arc), 5e-9) << latitude;
            EXPECT_NEAR(at.y, 500000, 1e-9);
        }
    }
}

TEST(GeoSystem, UtmIsConformal) {
    const GeoSystem utm = systemOf({"UTM", "Z32"}), gd = systemOf({"GD"});
    const double step = 1e-4;
    const auto at = [&](double latitude, double longitude) {
        return utm.fromGeocentric(gd.toGeocentric({latitude, longitude, 0}));
    };
    for (double latitude = -75; latitude <= 75; latitude += 15)
        for (double longitude = 4; longitude <= 14; longitude += 2.5) {
            const auto metresOf = [&](double dLatitude, double dLongitude) {
                return glm::length(gd.toGeocentric({latitude + dLatitude, longitude + dLongitude, 0}) -
                                   gd.toGeocentric({latitude - dLatitude, longitude - dLongitude, 0}));
            };
            const Vec3d north = (at(latitude + step, longitude) - at(latitude - step, longitude)) / metresOf(step, 0);
            const Vec3d east = (at(latitude, longitude + step) - at(latitude, longitude - step)) / metresOf(0, step);
            // north.x is the northing; turned by a right angle they are the same, and as long.
            EXPECT_NEAR(north.x, east.y, 1e-8) << latitude << ' ' << longitude;
            EXPECT_NEAR(north.y, -east.x, 1e-8) << latitude << ' ' << longitude;
        }
}

TEST(GeoSystem, UtmRoundTripsOverTheGlobe) {
    for (int zone = 1; zone <= 60; zone += 7) {
        const std::string word = "Z" + std::to_string(zone);
        const GeoSystem north = systemOf({"UTM", word.c_str()}), south = systemOf({"UTM", word.c_str(), "S"});
        const GeoSystem gd = systemOf({"GD"});
        for (double latitude = -84; latitude <= 84; latitude += 6)
            for (double by = -30; by <= 30; by += 7.5) {
                const double longitude = std::remainder(6 * zone - 183 + by, 360);
                const GeoSystem& utm = latitude < 0 ? south : north;
                const Vec3d position = utm.fromGeocentric(gd.toGeocentric({latitude, longitude, 77}));
                const Vec3d back = gd.fromGeocentric(utm.toGeocentric(position));
                const double error =
                    glm::length(utm.toGeocentric(position) - gd.toGeocentric({latitude, longitude, 77}));
                EXPECT_LT(error, std::abs(by) <= 3.75 ? 1e-8 : 1e-6) << latitude << ' ' << longitude;
                EXPECT_NEAR(back.x, latitude, std::abs(by) <= 3.75 ? 1e-12 : 1e-9);
                EXPECT_NEAR(std::remainder(back.y - longitude, 360), 0, 1e-9);
            }
    }
}

TEST(GeoSystem, OrdersHemispheresAndSynonyms) {
    const Vec3d here(46.5, 7.25, 400);
    const Vec3d point = systemOf({"GD", "WE"}).toGeocentric(here);
    EXPECT_EQ(systemOf({"GDC", "longitude_first"}).toGeocentric({7.25, 46.5, 400}), point);
    EXPECT_EQ(systemOf({"GC"}).toGeocentric(point), point);
    EXPECT_EQ(systemOf({"GCC"}).fromGeocentric(point), point);
    const Vec3d north = systemOf({"UTM", "Z32"}).fromGeocentric(point);
    const Vec3d swapped = systemOf({"UTM", "Z32", "easting_first"}).fromGeocentric(point);
    EXPECT_EQ(swapped, Vec3d(north.y, north.x, north.z));
    EXPECT_EQ(systemOf({"UTM", "Z32", "S"}).fromGeocentric(point).x, north.x + 1e7);
    EXPECT_NE(systemOf({"GD", "CC"}).toGeocentric(here), point);
    EXPECT_NE(errorOf({"UTM"}).find("zone"), std::string::npos);
    EXPECT_NE(errorOf({"UTM", "Z61"}).find("'Z61'"), std::string::npos);
    EXPECT_NE(errorOf({"GD", "WGS"}).find("'WGS'"), std::string::npos);
}

}  // namespace rtsg
