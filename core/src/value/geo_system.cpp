// Converts geographic coordinates to geocentric ones and back: ellipsoids, geodetic latitudes, UTM by Krueger's series.
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include <fmt/format.h>

#include <rtsg/core/geo_system.h>
#include <rtsg/core/portable_math.h>

namespace rtsg {

namespace {

struct NamedEllipsoid {
    std::string_view code;
    Ellipsoid ellipsoid;
};
/// Table 25.3
constexpr NamedEllipsoid kEllipsoids[] = {
    {"AA", {6377563.396, 299.3249646}}, {"AM", {6377340.189, 299.3249646}},
    {"AN", {6378160, 298.25}},          {"BN", {6377483.865, 299.1528128}},
    {"BR", {6377397.155, 299.1528128}}, {"CC", {6378206.4, 294.9786982}},
    {"CD", {6378249.145, 293.465}},     {"EA", {6377276.345, 300.8017}},
    {"EB", {6377298.556, 300.8017}},    {"EC", {6377301.243, 300.8017}},
    {"ED", {6377295.664, 300.8017}},    {"EE", {6377304.063, 300.8017}},
    {"EF", {6377309.613, 300.8017}},    {"FA", {6378155, 298.3}},
    {"HE", {6378200, 298.3}},           {"HO", {6378270, 297}},
    {"ID", {6378160, 298.247}},         {"IN", {6378388, 297}},
    {"KA", {6378245, 298.3}},           {"RF", {6378137, 298.257222101}},
    {"SA", {6378160, 298.25}},          {"WD", {6378135, 298.26}},
    {"WE", {6378137, 298.257223563}},
};

constexpr double kDegree = M_PI / 180;
constexpr double kScaleInMiddle = .9996, kFalseEasting = 500000, kFalseNorthing = 10000000;

/// Latitude and longitude in radians, height in metres.
struct Geodetic {
    double latitude, longitude, height;
};

Vec3d geocentricOf(const Ellipsoid& e, const Geodetic& g) {
    const double f = e.flattening(), e2 = f * (2 - f);
    const double s = portable::sin(g.latitude), c = portable::cos(g.latitude);
    const double n = e.equatorialRadius / std::sqrt(1 - e2 * s * s);
    const double across = (n + g.height) * c;
    return {across * portable::cos(g.longitude), across * portable::sin(g.longitude), (n * (1 - e2) + g.height) * s};
}

Geodetic geodeticOf(const Ellipsoid& e, const Vec3d& p) {
    const double a = e.equatorialRadius, f = e.flattening(), b = a * (1 - f), e2 = f * (2 - f);
    const double across = portable::hypot(p.x, p.y);
    const double longitude = across > 0 ? portable::atan2(p.y, p.x) : 0;
    if (!(across > 0)) return {std::copysign(M_PI / 2, p.z), longitude, std::abs(p.z) - b};
    // Bowring's step from one reduced latitude to the next; from the surface the second changes nothing any more.
    double tangent = p.z * a / (across * b), latitude = 0;
    for (int step = 0; step < 30; ++step) {
        const double c = 1 / std::sqrt(1 + tangent * tangent), s = tangent * c;
        const double next = portable::atan2(p.z + e2 / (1 - e2) * b * s * s * s, across - e2 * a * c * c * c);
        const bool done = std::abs(next - latitude) <= 1e-17;
        latitude = next;
        tangent = (1 - f) * portable::tan(latitude);
        if (done) break;
    }
    const double s = portable::sin(latitude), c = portable::cos(latitude);
    return {latitude, longitude, across * c + p.z * s - a * std::sqrt(1 - e2 * s * s)};
}

/// Krueger's series of a transverse Mercator projection in the third flattening.
struct Krueger {
    double eccentricity, radius;  // radius: of the circle as long as a meridian
    std::array<double, 6> forth, back;
};

double polynomial(double n, std::initializer_list<double> coefficients) {
    double sum = 0;
    for (auto c = std::rbegin(coefficients); c != std::rend(coefficients); ++c) sum = (sum + *c) * n;
    return sum;
}

Krueger kruegerOf(const Ellipsoid& e) {
    const double f = e.flattening(), n = f / (2 - f), n2 = n * n;
    Krueger k;
    k.eccentricity = std::sqrt(f * (2 - f));
    k.radius = e.equatorialRadius / (1 + n) * (1 + n2 * (1. / 4 + n2 * (1. / 64 + n2 / 256)));
    k.forth = {polynomial(n, {1. / 2, -2. / 3, 5. / 16, 41. / 180, -127. / 288, 7891. / 37800}),
               polynomial(n, {0, 13. / 48, -3. / 5, 557. / 1440, 281. / 630, -1983433. / 1935360}),
               polynomial(n, {0, 0, 61. / 240, -103. / 140, 15061. / 26880, 167603. / 181440}),
               polynomial(n, {0, 0, 0, 49561. / 161280, -179. / 168, 6601661. / 7257600}),
               polynomial(n, {0, 0, 0, 0, 34729. / 80640, -3418889. / 1995840}),
               polynomial(n, {0, 0, 0, 0, 0, 212378941. / 319334400})};
    k.back = {polynomial(n, {1. / 2, -2. / 3, 37. / 96, -1. / 360, -81. / 512, 96199. / 604800}),
              polynomial(n, {0, 1. / 48, 1. / 15, -437. / 1440, 46. / 105, -1118711. / 3870720}),
              polynomial(n, {0, 0, 17. / 480, -37. / 840, -209. / 4480, 5569. / 90720}),
              polynomial(n, {0, 0, 0, 4397. / 161280, -11. / 504, -830251. / 7257600}),
              polynomial(n, {0, 0, 0, 0, 4583. / 161280, -108847. / 3991680}),
              polynomial(n, {0, 0, 0, 0, 0, 20648693. / 638668800})};
    return k;
}

/// Tangent of the conformal latitude of a latitude's.
double conformalTangent(double tangent, double eccentricity) {
    const double secant = std::sqrt(1 + tangent * tangent);
    const double s = portable::sinh(eccentricity * portable::atanh(eccentricity * tangent / secant));
    return tangent * std::sqrt(1 + s * s) - s * secant;
}
/// The other way round, by Newton's method (Karney, equations 19 to 21).
double tangentOf(double conformal, double eccentricity) {
    const double e2m = 1 - eccentricity * eccentricity;
    double tangent = conformal / e2m;
    if (!std::isfinite(tangent)) return tangent;
    for (int step = 0; step < 8; ++step) {
        const double found = conformalTangent(tangent, eccentricity);
        const double by = (conformal - found) / std::sqrt(1 + found * found) * (1 + e2m * tangent * tangent) /
                          (e2m * std::sqrt(1 + tangent * tangent));
        tangent += by;
        if (!(std::abs(by) > 1e-16 * std::max(1.0, std::abs(tangent)))) break;
    }
    return tangent;
}

double middleOfZone(int zone) {
    return (6 * zone - 183) * kDegree;
}

/// To the east and north of where the zone's middle crosses the equator; metres.
Vec2d projected(const Ellipsoid& e, int zone, const Geodetic& g) {
    const Krueger k = kruegerOf(e);
    const double longitude = std::remainder(g.longitude - middleOfZone(zone), 2 * M_PI);
    const double t = conformalTangent(portable::tan(g.latitude), k.eccentricity);
    const double c = portable::cos(longitude);
    const double xi = portable::atan2(t, c), eta = portable::asinh(portable::sin(longitude) / portable::hypot(t, c));
    double north = xi, east = eta;
    for (int j = 0; j < 6; ++j) {
        const double m = 2 * (j + 1);
        north += k.forth[std::size_t(j)] * portable::sin(m * xi) * portable::cosh(m * eta);
        east += k.forth[std::size_t(j)] * portable::cos(m * xi) * portable::sinh(m * eta);
    }
    return Vec2d(east, north) * (kScaleInMiddle * k.radius);
}

Geodetic unprojected(const Ellipsoid& e, int zone, const Vec2d& planar, double height) {
    const Krueger k = kruegerOf(e);
    const Vec2d at = planar / (kScaleInMiddle * k.radius);
    double xi = at.y, eta = at.x;
    for (int j = 0; j < 6; ++j) {
        const double m = 2 * (j + 1);
        xi -= k.back[std::size_t(j)] * portable::sin(m * at.y) * portable::cosh(m * at.x);
        eta -= k.back[std::size_t(j)] * portable::cos(m * at.y) * portable::sinh(m * at.x);
    }
    const double c = portable::cos(xi), sh = portable::sinh(eta);
    const double tangent = tangentOf(portable::sin(xi) / portable::hypot(sh, c), k.eccentricity);
    return {portable::atan(tangent), middleOfZone(zone) + portable::atan2(sh, c), height};
}

bool takeZone(std::string_view word, int& zone) {
    if (word.size() < 2 || word[0] != 'Z') return false;
    const char* end = word.data() + word.size();
    const auto [rest, error] = std::from_chars(word.data() + 1, end, zone);
    return error == std::errc() && rest == end && zone >= 1 && zone <= 60;
}

}  // namespace

Result<GeoSystem> GeoSystem::read(const Array<String>& words) {
    GeoSystem system;
    bool south = false;
    for (const String& one : words) {
        const std::string_view word = one.view();
        const auto* named = std::ranges::find(kEllipsoids, word, &NamedEllipsoid::code);
        if (word == "GD" || word == "GDC")
            system.kind = Kind::geodetic;
        else if (word == "UTM")
            system.kind = Kind::utm;
        else if (word == "GC" || word == "GCC" || word == "GS")
            system.kind = Kind::geocentric;
        else if (named != std::end(kEllipsoids))
            system.ellipsoid = named->ellipsoid;
        else if (word == "longitude_first" || word == "easting_first")
            system.isSwapped = true;
        else if (word == "S")
            south = true;
        else if (word != "latitude_first" && word != "northing_first" && word != "WGS84" && word != "N" &&
                 !takeZone(word, system.zone))
            return fail(fmt::format("geoSystem: '{}' is no word of ISO/IEC 19775-1 25.2.3", word));
    }
    if (system.kind != Kind::utm) system.zone = 0;
    if (system.kind == Kind::utm && system.zone == 0) return fail("geoSystem: UTM needs a zone, \"Z1\" to \"Z60\"");
    system.isSouthern = south && system.kind == Kind::utm;
    return system;
}

Vec3d GeoSystem::toGeocentric(const Vec3d& given) const {
    if (kind == Kind::geocentric) return given;
    const Vec3d c = isSwapped ? Vec3d(given.y, given.x, given.z) : given;
    if (kind == Kind::geodetic) return geocentricOf(ellipsoid, {c.x * kDegree, c.y * kDegree, c.z});
    const Vec2d planar(c.y - kFalseEasting, c.x - (isSouthern ? kFalseNorthing : 0));
    return geocentricOf(ellipsoid, unprojected(ellipsoid, zone, planar, c.z));
}

Vec3d GeoSystem::fromGeocentric(const Vec3d& point) const {
    if (kind == Kind::geocentric) return point;
    const Geodetic g = geodeticOf(ellipsoid, point);
    Vec3d c(g.latitude / kDegree, g.longitude / kDegree, g.height);
    if (kind == Kind::utm) {
        const Vec2d planar = projected(ellipsoid, zone, g);
        c.x = planar.y + (isSouthern ? kFalseNorthing : 0), c.y = planar.x + kFalseEasting;
    }
    return isSwapped ? Vec3d(c.y, c.x, c.z) : c;
}

glm::dmat3 GeoSystem::frameAt(const Vec3d& point) const {
    if (!(glm::length(point) > 0) || !std::isfinite(glm::length(point))) return glm::dmat3(1);
    const Geodetic g = geodeticOf(ellipsoid, point);
    const double s = portable::sin(g.latitude), c = portable::cos(g.latitude);
    const double across = portable::hypot(point.x, point.y);
    const double cosine = across > 0 ? point.x / across : 1, sine = across > 0 ? point.y / across : 0;
    return {{-sine, cosine, 0}, {c * cosine, c * sine, s}, {s * cosine, s * sine, -c}};
}

}  // namespace rtsg
