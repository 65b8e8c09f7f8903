// A plug-in to start from: a node that acts, a geometry, a field type, a format to read, a format to write, and a
// subscriber.
#include <algorithm>
#include <charconv>
#include <iostream>
#include <map>
#include <string>

#include <rtsg/documents/filter.h>
#include <rtsg/plugins/plugin.h>
#include <rtsg/renderers/mesh.h>

#include "workshop.h"

namespace {

using namespace rtsg;

/// The behaviour of a Spinner: it is called each frame, since it asks for a time that has come by then.
double spin(Cascade& cascade, const Node& node) {
    const double rotations = node.get(workshop::Spinner::turnsPerSecond) * cascade.now();
    const auto angle =
        static_cast<float>((rotations - static_cast<double>(static_cast<long long>(rotations))) * 6.283185307179586);
    cascade.emit(node, workshop::Spinner::rotation_changed, Rotation{0, 1, 0, angle});
    return cascade.now();
}

/// The triangles of a Pane: a square.
std::shared_ptr<const Mesh> paneMesh(const Scene& scene, NodeId id) {
    const float half = scene.node(id).get(workshop::Pane::halfSize);
    auto mesh = std::make_shared<Mesh>();
    mesh->positions = {{-half, -half, 0}, {half, -half, 0}, {half, half, 0}, {-half, half, 0}};
    mesh->triangles = {0, 1, 2, 0, 2, 3};
    mesh->triangleCount = 2;
    mesh->solid = false;
    mesh->texCoords.emplace_back();
    for (const Vec3f& point : mesh->positions) mesh->bounds.extend(point);
    return mesh;
}

/// An SFQuantity is a number and which of these units it counts in, written as "3.5 kg".
constexpr std::string_view kUnits[] = {"1", "m", "kg", "s"};

std::string printQuantity(const CustomValue& value) {
    const std::vector<double> numbers = customNumbers(value);
    char digits[40];
    const auto end = std::to_chars(digits, digits + sizeof(digits), numbers[0]).ptr;
    const bool isKnown = numbers[1] >= 0 && numbers[1] < std::size(kUnits);
    return std::string(digits, end) + ' ' + (isKnown ? std::string(kUnits[static_cast<std::size_t>(numbers[1])]) : "?");
}

Result<CustomValue> parseQuantity(const CustomType& type, std::string_view text) {
    double numbers[2] = {};
    const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), numbers[0]);
    const std::string_view unit = text.substr(std::min(text.size(), text.find_last_of(' ') + 1));
    const auto found = std::find(std::begin(kUnits), std::end(kUnits), unit);
    if (error != std::errc() || found == std::end(kUnits)) return fail("expected a number and 1, m, kg or s");
    numbers[1] = static_cast<double>(found - std::begin(kUnits));
    return type.value(numbers);
}

/// Files called .points: three numbers a line.
bool readPoints(FormatSource& source, DocumentHandler& handler, Diagnostics& diagnostics) {
    Array<Vec3f> points;
    std::uint32_t number = 0;
    for (std::string_view rest = source.bytes(); !rest.empty();) {
        std::string_view line = rest.substr(0, rest.find('\n'));
        rest.remove_prefix(std::min(rest.size(), line.size() + 1));
        ++number;
        Vec3f point;
        const char* at = line.data();
        const char* const end = at + line.find_last_not_of(" \t\r") + 1;
        if (at == end) continue;
        bool good = true;
        for (int i = 0; i < 3 && good; ++i) {
            while (at != end && (*at == ' ' || *at == '\t')) ++at;
            const auto [next, error] = std::from_chars(at, end, point[i]);
            good = error == std::errc();
            at = next;
        }
        if (good && at == end)
            points.push_back(point);
        else
            diagnostics.error({number, 1}, "expected three numbers");
    }
    handler.beginDocument({});
    handler.beginNode("Shape", {}, {}, {});
    handler.beginNode("PointSet", {}, "geometry", {});
    handler.beginNode("Coordinate", {}, "coord", {});
    handler.setField("point", Value(points), {});
    for (int open = 0; open < 3; ++open) handler.endNode({});
    handler.endDocument();
    return true;
}

/// Writes which node hangs in which, as a graph for Graphviz.
class DotWriter final : public Filter {
  public:
    explicit DotWriter(TextSink sink) : sink_(std::move(sink)) {}
    void beginDocument(const DocumentHeader&) override { sink_("digraph scene {\n"); }
    void endDocument() override { sink_("}\n"); }
    void beginNode(std::string_view type, std::string_view def, std::string_view field, SourceLocation) override {
        const std::string name = 'n' + std::to_string(count_++);
        sink_("  " + name + " [label=\"" + (def.empty() ? "" : std::string(def) + ' ') + std::string(type) + "\"];\n");
        if (!open_.empty()) sink_("  " + open_.back() + " -> " + name + " [label=\"" + std::string(field) + "\"];\n");
        open_.push_back(name);
        if (!def.empty()) names_[std::string(def)] = name;
    }
    void endNode(SourceLocation) override { open_.pop_back(); }
    void useNode(std::string_view def, std::string_view field, SourceLocation) override {
        const auto used = names_.find(std::string(def));
        if (used != names_.end() && !open_.empty())
            sink_("  " + open_.back() + " -> " + used->second + " [label=\"" + std::string(field) + "\"];\n");
    }

  private:
    TextSink sink_;
    std::size_t count_ = 0;
    std::vector<std::string> open_;
    std::map<std::string, std::string> names_;
};

/// Counts the changes of the scene that the program runs, and says in the end how many there were.
struct Counter final : Subscriber {
    ~Counter() override { std::cerr << "workshop: " << changes << " changes\n"; }
    Result<> apply(const Scene&, const ChangeSet& set) override {
        if (!set.isSnapshot()) changes += set.changes.size();
        return {};
    }
    std::size_t changes = 0;
};

}  // namespace

RTSG_PLUGIN(extensions) {
    const CustomLayout layout{CustomLayout::Of::float64, 2};
    const auto quantity =
        extensions.addFieldType("SFQuantity", layout, {.print = printQuantity, .parse = parseQuantity});
    if (!quantity) return std::unexpected(quantity.error());
    if (auto ok = extensions.add(workshop::nodeTypes()); !ok) return ok;
    extensions.addBehaviour("Spinner", {.onTime = spin, .deterministic = true});
    extensions.addMeshSource("Pane", paneMesh);
    extensions.add(FormatReader{.name = "point",
                                .recognises = [](const FormatClue& clue) { return clue.name.ends_with(".points"); },
                                .read = readPoints,
                                .isText = true});
    extensions.add(FormatWriter{.name = "DOT", .extensions = {".dot"}, .make = [](TextSink sink, Diagnostics&) {
                                    return std::make_unique<DotWriter>(std::move(sink));
                                }});
    extensions.addSubscriber([](Scene&) { return std::make_unique<Counter>(); });
    return {};
}
