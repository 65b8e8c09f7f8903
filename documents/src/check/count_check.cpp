// Finds lists of a node that do not fit each other, and fields that make no sense with the values of others.
#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <string_view>

#include "validated_node.h"

namespace rtsg::detail {

namespace {

constexpr std::size_t kNone = ValidatedNode::kNone;

/// A field that takes a fixed number of values.
struct Fixed {
    const char *type, *field;
    std::size_t count;
};
constexpr Fixed kFixed[] = {{"OrthoViewpoint", "fieldOfView", 4},  // 23.4.5
                            {"NavigationInfo", "avatarSize", 3}};  // 23.4.4

class CountCheck {
  public:
    CountCheck(const ValidatedNode& node, SourceLocation where, Diagnostics& diagnostics)
        : node_(node), where_(where), diagnostics_(diagnostics) {}

    void all() {
        for (const Fixed& one : kFixed)
            if (is(one.type)) fixed(one);
        if (node_.type->isA("X3DBackgroundNode")) {
            ascending<float>("skyAngle");
            ascending<float>("groundAngle");
            colors("skyColor", "skyAngle");
            colors("groundColor", "groundAngle");
        }
        if (is("LOD") || is("GeoLOD")) ascending<float>("range");
        if (is("HAnimJoint")) skin();
        if (is("ParticleSystem")) {
            keys("colorKey", "color", "colours");
            ascending<float>("colorKey");
            ascending<float>("texCoordKey");
        }
        if (is("TextureCoordinateGenerator")) noise();
        if (is("PixelTexture3D")) block();
        if (is("TextureProjector") || is("TextureProjectorParallel") || is("TextureProjectorPerspective")) picture();
        if (is("Appearance")) backs();
        if (is("ClipPlane")) plane();
        weights();
        if (is("NavigationInfo")) navigation();
        if (is("GeoLocation") || is("GeoTransform") || is("GeoViewpoint")) latitude();
    }

  private:
    bool is(std::string_view type) const { return node_.type->name == type; }
    void say(const char* field, const std::string& text, DiagnosticCode code) {
        diagnostics_.warning(node_.at(field, where_), text, code);
    }
    static std::string many(std::size_t count, const std::string& what) {
        return std::to_string(count) + " " +
               (count == 1 && what.ends_with('s') ? what.substr(0, what.size() - 1) : what);
    }

    template <class T>
    void ascending(const char* field) {
        const Array<T>* values = node_.array<T>(field);
        if (values && !std::ranges::is_sorted(values->span()))
            say(field, std::string(field) + " of " + node_.type->name + " does not ascend",
                DiagnosticCode("behaviour"));
    }
    void fixed(const Fixed& one) {
        std::size_t count = kNone;
        if (const auto* floats = node_.array<float>(one.field)) count = floats->size();
        if (const auto* doubles = node_.array<double>(one.field)) count = doubles->size();
        if (count == kNone || count == one.count) return;
        say(one.field,
            std::string(one.field) + " of " + node_.type->name + " has " + many(count, "values") + "; it takes " +
                std::to_string(one.count),
            DiagnosticCode("behaviour"));
    }
    /// One colour more than angles (24.4.1), or no ground at all.
    void colors(const char* color, const char* angle) {
        const auto* colors = node_.array<Color>(color);
        const auto* angles = node_.array<float>(angle);
        if (!colors && !angles) return;
        if (node_.isConnected && (!colors || !angles)) return;  // the other may come by IS
        const std::size_t have = colors ? colors->size() : 1, between = angles ? angles->size() : 0;
        if (have == between + 1 || (have == 0 && between == 0) || (!colors && between == 0)) return;
        say(colors ? color : angle,
            node_.type->name + " has " + many(have, std::string(color) + "s") + " for " +
                many(between, std::string(angle) + "s") + "; it takes one more than these",
            DiagnosticCode("behaviour"));
    }
    void keys(const char* key, const char* child, const char* what) {
        const auto* keys = node_.array<float>(key);
        const std::size_t count = node_.countIn(child);
        if (!keys || count == kNone || keys->size() == count) return;
        say(key,
            std::string(key) + " of " + node_.type->name + " has " + many(keys->size(), "keys") + " for " +
                many(count, what),
            DiagnosticCode("behaviour"));
    }
    void skin() {
        const auto* indices = node_.array<std::int32_t>("skinCoordIndex");
        const auto* weights = node_.array<float>("skinCoordWeight");
        if (!indices || !weights || weights->empty() || weights->size() == indices->size()) return;
        say("skinCoordWeight",
            "HAnimJoint has " + many(weights->size(), "skinCoordWeights") + " for " +
                many(indices->size(), "skinCoordIndexes"),
            DiagnosticCode("behaviour"));
    }
    /// 18.4.8: NOISE takes a scale and a translation; the others one number, a point or both at most.
    void noise() {
        const auto mode = node_.given.find("mode");
        const auto* numbers = node_.array<float>("parameter");
        if (!numbers || numbers->empty() || mode == node_.given.end() || !mode->second.value.holds<String>()) return;
        const std::string_view word = mode->second.value.as<String>().view();
        if (!word.starts_with("NOISE") || numbers->size() == 6) return;
        say("parameter",
            "parameter of TextureCoordinateGenerator has " + many(numbers->size(), "values") + "; " +
                std::string(word) + " takes 6",
            DiagnosticCode("geometry"));
    }
    /// 33.4.3: components, width, height, depth, and as many texels.
    void block() {
        const auto* words = node_.array<std::int32_t>("image");
        if (!words || words->empty()) return;
        const auto number = [&](std::size_t i) { return std::max<std::int64_t>((*words)[i], 0); };
        if (words->size() < 4)
            return say("image",
                       "image of PixelTexture3D has " + many(words->size(), "numbers") +
                           "; it begins with components, width, height and depth",
                       DiagnosticCode("picture"));
        const std::int64_t wanted = number(1) * number(2) * number(3);
        if (static_cast<std::int64_t>(words->size()) - 4 != wanted)
            say("image",
                "image of PixelTexture3D has " + many(words->size() - 4, "texels") + " for a block of " +
                    std::to_string(wanted),
                DiagnosticCode("picture"));
    }
    void picture() {
        if (!node_.isConnected && !node_.children.contains("texture"))
            say("texture", node_.type->name + " has no texture: it throws nothing", DiagnosticCode("picture"));
    }
    /// 12.4.2: both materials shall be of one type.
    void backs() {
        const auto front = node_.children.find("material"), back = node_.children.find("backMaterial");
        if (front == node_.children.end() || back == node_.children.end()) return;
        if (front->second.type == back->second.type || front->second.type.empty() || back->second.type.empty()) return;
        say("backMaterial",
            "backMaterial is of type " + back->second.type + " and material of type " + front->second.type +
                "; they are to be of one",
            DiagnosticCode("picture"));
    }
    void plane() {
        const auto given = node_.given.find("plane");
        if (given == node_.given.end() || !given->second.value.holds<Vec4f>()) return;
        const Vec4f& plane = given->second.value.as<Vec4f>();
        if (plane.x == 0 && plane.y == 0 && plane.z == 0)
            say("plane", "plane of ClipPlane has no direction: it cuts nothing", DiagnosticCode("picture"));
    }
    void weights() {
        const auto* weights = node_.array<double>("weight");
        if (!weights || weights->empty() || !node_.type->component.starts_with("NURBS")) return;
        const std::size_t points = node_.countIn("controlPoint");
        if (points == kNone || points == weights->size()) return;
        say("weight",
            node_.type->name + " has " + many(weights->size(), "weights") + " for " + many(points, "control points"),
            DiagnosticCode("geometry"));
    }
    void navigation() {
        constexpr std::array<std::string_view, 8> kWords{"ANY",    "WALK", "EXAMINE", "FLY",
                                                         "LOOKAT", "NONE", "EXPLORE", "EXPLORER"};
        const auto* types = node_.array<String>("type");
        if (!types) return;
        for (const String& word : *types)
            if (std::ranges::find(kWords, word.view()) == kWords.end())
                say("type", "'" + word.str() + "' is no type of navigation that is known here",
                    DiagnosticCode("behaviour"));
    }
    /// 25.2.3: of geodetic coordinates the first is the latitude, unless they say otherwise.
    void latitude() {
        const char* field = is("GeoTransform") ? "geoCenter" : is("GeoViewpoint") ? "position" : "geoCoords";
        const auto given = node_.given.find(field);
        if (given == node_.given.end() || !given->second.value.holds<Vec3d>()) return;
        bool geodetic = true, longitudeFirst = false;
        if (const auto* system = node_.array<String>("geoSystem")) {
            geodetic = !system->empty() && ((*system)[0].view() == "GD" || (*system)[0].view() == "GDC");
            for (const String& word : *system) longitudeFirst |= word.view() == "longitude_first";
        }
        const Vec3d& position = given->second.value.as<Vec3d>();
        const double angle = longitudeFirst ? position.y : position.x;
        if (geodetic && std::abs(angle) > 90)
            say(field, std::string(field) + " of " + node_.type->name + " has a latitude beyond 90 degrees",
                DiagnosticCode("geography"));
    }

    const ValidatedNode& node_;
    SourceLocation where_;
    Diagnostics& diagnostics_;
};

}  // namespace

void checkCounts(const ValidatedNode& node, SourceLocation where, Diagnostics& diagnostics) {
    if (node.type) CountCheck(node, where, diagnostics).all();
}

}  // namespace rtsg::detail
