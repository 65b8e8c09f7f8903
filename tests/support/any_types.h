// Seeded scenes and edits with nodes of every built-in type: what a field accepts, and now and then what it does not.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

namespace rtsg::test {

class AnyTypes {
  public:
    /// `wild`: the share of numbers that are far from what a field is for.
    AnyTypes(Scene& scene, std::uint64_t seed, double wild) : scene_(scene), random_(seed), wild_(wild) {}

    /// A node of a random type with what hangs below it, as a child of the root.
    void grow() {
        budget_ = 60;
        if (const NodeId id = node("X3DChildNode", 5))
            (void)scene_.insertChild(scene_.root(), x3d::RtsgScene::children, id);
    }
    /// Writes a field, sends an event, adds or removes a route, moves or destroys a node. Edits that the scene refuses
    /// count.
    void edit() {
        if (nodes_.empty()) return grow();
        switch (pick(12)) {
            case 0:
                return route();
            case 1:
                return unroute();
            case 2:
                return destroy();
            case 3:
                (void)scene_.insertChild(scene_.root(), x3d::RtsgScene::children, any());
                return;
            case 4:
            case 5:
                return write(true);
            default:
                return write(false);
        }
    }
    std::size_t size() const { return nodes_.size(); }

  private:
    std::size_t pick(std::size_t n) { return random_() % n; }
    bool chance(double fraction) { return std::bernoulli_distribution(fraction)(random_); }
    NodeId any() { return nodes_[pick(nodes_.size())]; }

    static bool isUsed(const NodeType& type) { return !type.internal && type.kind == NodeType::Kind::builtin; }
    static std::vector<TypeIndex> typesOf(std::string_view accepted) {
        static std::vector<std::pair<std::string, std::vector<TypeIndex>>> known;
        for (const auto& [name, types] : known)
            if (name == accepted) return types;
        std::vector<TypeIndex> found;
        const auto all = builtinTypes();
        for (std::size_t i = 0; i < all.size(); ++i)
            if (isUsed(*all[i]) && all[i]->isA(accepted)) found.push_back(static_cast<TypeIndex>(i));
        return known.emplace_back(std::string(accepted), std::move(found)).second;
    }
    /// None if there is no type of that kind, or the scene has grown enough.
    NodeId node(std::string_view accepted, int depth) {
        const std::vector<TypeIndex> types = typesOf(accepted);
        if (types.empty() || budget_ == 0) return {};
        --budget_;
        // Half of what may be a Shape is one, or there would be little to see.
        TypeIndex type = types[pick(types.size())];
        for (const TypeIndex likely : {x3d::Shape::type, x3d::Transform::type, x3d::Sound::type})
            if (chance(.2) && std::find(types.begin(), types.end(), likely) != types.end()) type = likely;
        const NodeId id = scene_.createNode(type);
        nodes_.push_back(id);
        const NodeType& created = scene_.node(id).type();
        for (std::size_t i = 0; i < created.fields.size(); ++i) {
            const FieldDef& def = created.fields[i];
            if (def.hidden || def.access == Access::inputOnly || def.access == Access::outputOnly) continue;
            const bool holdsNodes = sf(def.type) == FieldType::SFNode;
            if (!chance(holdsNodes ? def.name == "metadata" ? .02 : .8 : .3)) continue;
            (void)scene_.setField(id, static_cast<FieldIndex>(i), value(def, depth));
        }
        return id;
    }
    NodeId nodeFor(const FieldDef& def, int depth) {
        if (depth <= 0 || chance(.1)) return nodes_.empty() ? NodeId{} : any();
        return node(def.accepts.empty() ? "X3DChildNode" : std::string_view(def.accepts[pick(def.accepts.size())]),
                    depth - 1);
    }

    double number(const FieldDef& def) {
        if (chance(wild_)) {
            static constexpr double wild[] = {NAN,  INFINITY, -INFINITY, 3e38, -3e38, 1e20,
                                              -1e9, 1e9,      1e-30,     -1,   0,     65536};
            return wild[pick(std::size(wild))];
        }
        const double minimum = std::isfinite(def.min) ? def.min : std::isfinite(def.max) ? def.max - 6 : -3;
        const double maximum = std::isfinite(def.max) ? def.max : minimum + 6;
        if (chance(.2)) return chance(.5) ? minimum : maximum;
        return minimum + (maximum - minimum) * static_cast<double>(pick(1025)) / 1024;
    }
    std::int32_t integer() {
        if (chance(wild_ / 2)) {
            static constexpr std::int32_t wild[] = {std::numeric_limits<std::int32_t>::min(),
                                                    std::numeric_limits<std::int32_t>::max(), -2, 65536};
            return wild[pick(std::size(wild))];
        }
        return static_cast<std::int32_t>(pick(7)) - 1;
    }
    String text(const FieldDef& def) {
        if (!def.allowed.empty() && chance(.9)) return String(def.allowed[pick(def.allowed.size())]);
        static constexpr const char* texts[] = {"", "a", "A B", "\xC3\xA4\xE2\x82\xAC", "nothing.png"};
        return String(texts[pick(std::size(texts))]);
    }
    Image image() {
        const auto size = [&](std::size_t maximum) { return static_cast<std::int32_t>(pick(maximum + 1)); };
        Image result{{size(3), size(3), size(4)}};
        const int components = result.components();
        for (int i = result.width() * result.height(); i > 0; --i)
            result.words.push_back(static_cast<std::int32_t>(
                components == 4 ? random_() : random_() & ((std::uint64_t{1} << (8 * components)) - 1)));
        return result;
    }
    template <class T>
    T vector(const FieldDef& def) {
        T result;
        for (int i = 0; i < T::length(); ++i) result[i] = static_cast<typename T::value_type>(number(def));
        return result;
    }
    template <class T, class Make>
    Array<T> several(const Make& make) {
        static constexpr std::size_t lengths[] = {0, 1, 2, 3, 4, 4, 8, 12};
        Array<T> result;
        for (std::size_t i = lengths[pick(std::size(lengths))]; i > 0; --i) result.push_back(make());
        return result;
    }
    Value value(const FieldDef& def, int depth) {
        const auto real = [&] { return static_cast<float>(number(def)); };
        const auto color = [&] { return Color{real(), real(), real()}; };
        const auto colorAlpha = [&] { return ColorRGBA{real(), real(), real(), real()}; };
        const auto rotation = [&] { return Rotation{real(), real(), real(), real()}; };
        switch (def.type) {
            case FieldType::SFBool:
                return chance(.5);
            case FieldType::SFInt32:
                return integer();
            case FieldType::SFFloat:
                return real();
            case FieldType::SFDouble:
                return number(def);
            case FieldType::SFTime:
                return Time{number(def)};
            case FieldType::SFVec2f:
                return vector<Vec2f>(def);
            case FieldType::SFVec3f:
                return vector<Vec3f>(def);
            case FieldType::SFVec4f:
                return vector<Vec4f>(def);
            case FieldType::SFVec3d:
                return vector<Vec3d>(def);
            case FieldType::SFColor:
                return color();
            case FieldType::SFColorRGBA:
                return colorAlpha();
            case FieldType::SFRotation:
                return rotation();
            case FieldType::SFString:
                return text(def);
            case FieldType::SFImage:
                return image();
            case FieldType::SFNode:
                return nodeFor(def, depth);
            case FieldType::MFBool:
                return several<bool>([&] { return chance(.5); });
            case FieldType::MFInt32:
                return several<std::int32_t>([&] { return integer(); });
            case FieldType::MFFloat:
                return several<float>(real);
            case FieldType::MFDouble:
                return several<double>([&] { return number(def); });
            case FieldType::MFTime:
                return several<Time>([&] { return Time{number(def)}; });
            case FieldType::MFVec2f:
                return several<Vec2f>([&] { return vector<Vec2f>(def); });
            case FieldType::MFVec3f:
                return several<Vec3f>([&] { return vector<Vec3f>(def); });
            case FieldType::MFVec3d:
                return several<Vec3d>([&] { return vector<Vec3d>(def); });
            case FieldType::MFColor:
                return several<Color>(color);
            case FieldType::MFColorRGBA:
                return several<ColorRGBA>(colorAlpha);
            case FieldType::MFRotation:
                return several<Rotation>(rotation);
            case FieldType::MFString:
                return several<String>([&] { return text(def); });
            case FieldType::MFNode: {
                Array<NodeId> result;
                for (std::size_t i = pick(4); i > 0; --i)
                    if (const NodeId id = nodeFor(def, depth)) result.push_back(id);
                return result;
            }
            default:
                return Value::zero(def.type);
        }
    }
    void write(bool event) {
        const NodeId id = any();
        const NodeType& type = scene_.node(id).type();
        if (type.fields.empty()) return;
        const auto field = static_cast<FieldIndex>(pick(type.fields.size()));
        const FieldDef& def = type.fields[field];
        if (def.hidden) return;
        budget_ = 8;
        Value created = value(def, 2);
        if (event && def.writable())
            (void)scene_.sendEvent(id, field, std::move(created));
        else
            (void)scene_.setField(id, field, std::move(created));
    }
    void route() {
        const Node &a = scene_.node(any()), &b = scene_.node(any());
        if (a.type().fields.empty() || b.type().fields.empty()) return;
        for (int tries = 0; tries < 30; ++tries) {
            const auto from = static_cast<FieldIndex>(pick(a.type().fields.size()));
            const auto to = static_cast<FieldIndex>(pick(b.type().fields.size()));
            if (a.type().fields[from].hidden || b.type().fields[to].hidden) continue;
            if (scene_.addRoute(a.id(), from, b.id(), to)) return;
        }
    }
    void unroute() {
        const auto routes = scene_.routesFrom(any());
        if (routes.empty()) return;
        const Route& r = routes[pick(routes.size())];
        (void)scene_.removeRoute(r.fromNode, r.fromField, r.toNode, r.toField);
    }
    void destroy() {
        const std::size_t i = pick(nodes_.size());
        (void)scene_.destroyNode(nodes_[i]);
        nodes_.erase(nodes_.begin() + static_cast<std::ptrdiff_t>(i));
    }

    Scene& scene_;
    std::mt19937_64 random_;
    double wild_;
    std::size_t budget_ = 0;
    std::vector<NodeId> nodes_;
};

}  // namespace rtsg::test
