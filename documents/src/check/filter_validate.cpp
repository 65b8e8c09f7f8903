// Passes a document on unchanged, and reports problems of the document as a whole.
#include <algorithm>
#include <initializer_list>
#include <map>
#include <unordered_map>

#include <rtsg/core/nurbs.h>
#include <rtsg/core/script_language.h>
#include <rtsg/core/web_address.h>
#include <rtsg/documents/filter.h>

#include "commands/document_check.h"
#include "commands/value_numbers.h"
#include "validated_node.h"

namespace rtsg::detail {

namespace {

/// How many values the last of these fields that was given has.
std::size_t valuesOf(const ValidatedNode& node, std::initializer_list<const char*> fields) {
    std::size_t result = ValidatedNode::kNone;
    for (const char* field : fields)
        if (const auto found = node.given.find(field); found != node.given.end())
            result = elementsIn(found->second.value);
    return result;
}

struct Indices {
    const char *indices, *node, *values;  // `values`: of the node in field `node`
};
constexpr Indices kIndices[] = {{"coordIndex", "coord", "point"},     {"index", "coord", "point"},
                                {"colorIndex", "color", "color"},     {"normalIndex", "normal", "vector"},
                                {"normalIndex", "tangent", "vector"}, {"texCoordIndex", "texCoord", "point"}};

class Validate final : public Filter {
  public:
    Validate(DocumentHandler& next, Diagnostics& diagnostics, const ScriptLanguage* scripts,
             std::shared_ptr<const Dialect> dialect)
        : Filter(next), diagnostics_(diagnostics), scripts_(scripts), dialect_(std::move(dialect)) {}

    void beginDocument(const DocumentHeader& header) override {
        if (header.encoding != Encoding::vrml97) profile_.profile(header.profile, header.where, diagnostics_);
        if (header.encoding != Encoding::vrml97 && header.profile.empty())
            diagnostics_.warning(header.where,
                                 header.encoding == Encoding::classicVrml
                                     ? "there is no PROFILE, which every document of X3D names; Full is taken"
                                     : "X3D has no profile, which every document names; Full is taken",
                                 DiagnosticCode("profile"));
        Filter::beginDocument(header);
    }
    void component(std::string_view name, int level, SourceLocation where) override {
        if (!isOfDialect(name)) profile_.component(name, level, where, diagnostics_);
        Filter::component(name, level, where);
    }
    void beginNode(std::string_view type, std::string_view def, std::string_view field, SourceLocation where) override {
        const NodeType* known = protos_.contains(type) ? nullptr : findBuiltinType(type);
        if (known) profile_.node(*known, where, diagnostics_);
        if (known && open_.empty() && scopes_.size() == 1)
            if (const std::string why = notAtTheTop(*known); !why.empty())
                diagnostics_.warning(where, why, DiagnosticCode("build"));
        open_.emplace_back();
        open_.back().type = known, open_.back().def = def, open_.back().field = field;
        Filter::beginNode(type, def, field, where);
    }
    void endNode(SourceLocation where) override {
        if (!open_.empty()) {
            check(open_.back(), where);
            const ValidatedNode done = std::move(open_.back());
            open_.pop_back();
            if (done.type) {
                const bool counts = !done.type->isA("X3DGeometryNode");
                ValidatedNode::Child child{
                    done.type->name, counts ? valuesOf(done, {"point", "vector", "color"}) : kNone, {}};
                if (done.array<Vec3f>("point")) child.points = done.given.at("point").value;
                noteReach(done);
                if (!open_.empty()) open_.back().children[done.field] = child;
                if (!done.def.empty()) scopes_.back()[done.def] = child;
            } else if (!open_.empty()) {
                open_.back().children[done.field] = {};
            }
        }
        Filter::endNode(where);
    }
    void useNode(std::string_view def, std::string_view field, SourceLocation where) override {
        if (const auto found = scopes_.back().find(std::string(def)); found != scopes_.back().end() && !open_.empty())
            open_.back().children[std::string(field)] = found->second;
        else if (!open_.empty())
            open_.back().children[std::string(field)] = {};
        Filter::useNode(def, field, where);
    }
    void setField(std::string_view name, Value value, SourceLocation where) override {
        if (!open_.empty() && open_.back().type && sf(value.type()) != FieldType::SFNode)
            open_.back().given.insert_or_assign(std::string(name), ValidatedNode::Given{value, where});
        Filter::setField(name, std::move(value), where);
    }
    void isConnection(std::string_view nodeField, std::string_view protoField, SourceLocation where) override {
        if (!open_.empty()) open_.back().given.erase(std::string(nodeField)), open_.back().isConnected = true;
        Filter::isConnection(nodeField, protoField, where);
    }
    void beginProto(std::string_view name, SourceLocation where) override {
        protos_.emplace(name, true);
        Filter::beginProto(name, where);
    }
    void beginProtoBody(SourceLocation where) override {
        scopes_.emplace_back();
        Filter::beginProtoBody(where);
    }
    void endProto(SourceLocation where) override {
        scopes_.pop_back();
        Filter::endProto(where);
    }
    void externProto(std::string_view name, const std::vector<FieldDeclaration>& fields,
                     const std::vector<std::string>& url, SourceLocation where) override {
        protos_.emplace(name, true);
        Filter::externProto(name, fields, url, where);
    }

  private:
    static constexpr std::size_t kNone = ValidatedNode::kNone;

    void check(const ValidatedNode& node, SourceLocation where) {
        if (!node.type) return;
        checkCounts(node, where, diagnostics_);
        checkAreas(node, where, diagnostics_);
        checkReach(node);
        for (const Indices& one : kIndices) checkIndices(node, one);
        if (node.type->isA("X3DInterpolatorNode") || node.type->isA("X3DSequencerNode")) checkKeys(node, where);
        checkTangents(node, where);
        if (node.type->name == "ElevationGrid" || node.type->name == "GeoElevationGrid") checkHeights(node);
        if (node.type->name == "Script") checkScript(node);
        if (node.type->name == "NurbsPositionInterpolator" || node.type->name == "NurbsOrientationInterpolator") {
            if (const std::size_t points = node.countIn("controlPoint"); points != kNone)
                checkKnots(node, "knot", node.number("order", 3), static_cast<std::int64_t>(points), "");
        } else if (node.type->name == "NurbsSurfaceInterpolator") {
            checkKnots(node, "uKnot", node.number("uOrder", 3), node.number("uDimension", 0), " along u");
            checkKnots(node, "vKnot", node.number("vOrder", 3), node.number("vDimension", 0), " along v");
        }
    }
    /// Reports the faults of knots that an interpolator would report when it runs.
    void checkKnots(const ValidatedNode& node, const char* field, int order, std::int64_t points, const char* name) {
        const auto given = node.given.find(field);
        if (given == node.given.end() || !given->second.value.holds<Array<double>>()) return;
        const Array<double>& knots = given->second.value.as<Array<double>>();
        const auto count = static_cast<std::size_t>(std::max<std::int64_t>(points, 0));
        bool replaced = false;
        if (node.isConnected || knots.empty() || !NurbsBasis::fits(order, count)) return;
        (void)NurbsBasis(order, count, {knots.data(), knots.size()}, &replaced);
        if (replaced)
            diagnostics_.warning(given->second.where,
                                 "the knots" + std::string(name) + " of " + node.type->name + " do not fit " +
                                     std::to_string(count) + " control points of order " + std::to_string(order) +
                                     ": taken as even",
                                 DiagnosticCode("behaviour"));
    }
    void checkIndices(const ValidatedNode& node, const Indices& names) {
        const auto given = node.given.find(names.indices);
        const std::size_t count = node.countIn(names.node);
        if (given == node.given.end() || count == kNone || count == 0) return;
        if (!given->second.value.holds<Array<std::int32_t>>()) return;
        const Array<std::int32_t>& all = given->second.value.as<Array<std::int32_t>>();
        const auto bad = std::ranges::find_if(
            all.span(), [&](std::int32_t i) { return i < -1 || (i >= 0 && static_cast<std::size_t>(i) >= count); });
        if (bad == all.span().end()) return;
        diagnostics_.warning(given->second.where,
                             std::string(names.indices) + "[" + std::to_string(bad - all.span().begin()) + "] of " +
                                 node.type->name + " is " + std::to_string(*bad) + ", but " + names.node + " has " +
                                 std::to_string(count) + " elements, counted from 0",
                             DiagnosticCode("geometry"));
    }
    /// Has the figure that a joint or displacer belongs to know of its largest index.
    void noteReach(const ValidatedNode& done) {
        const bool isJoint = done.type->name == "HAnimJoint", isDisplacer = done.type->name == "HAnimDisplacer";
        if (!isJoint && !isDisplacer) return;
        const char* const field = isJoint ? "skinCoordIndex" : "coordIndex";
        const Array<std::int32_t>* all = done.array<std::int32_t>(field);
        if (!all || all->empty()) return;
        const auto largest = std::ranges::max_element(all->span());
        for (auto above = open_.rbegin(); above != open_.rend() && above->type; ++above) {
            const bool isSegment = above->type->name == "HAnimSegment";
            if (isSegment && isJoint) return;
            if (!isSegment && above->type->name != "HAnimHumanoid") continue;
            above->reaches.push_back({*largest,
                                      std::string(field) + "[" + std::to_string(largest - all->span().begin()) +
                                          "] of " + done.type->name + (done.def.empty() ? "" : " " + done.def),
                                      done.given.at(field).where});
            return;
        }
    }
    void checkReach(const ValidatedNode& node) {
        if (node.reaches.empty()) return;
        const char* points = node.type->name == "HAnimSegment" ? "coord" : "skinCoord";
        if (node.children.contains("skinBindingCoords")) points = "skinBindingCoords";
        const std::size_t count = node.countIn(points);
        if (count == kNone) return;
        for (const ValidatedNode::Reach& reach : node.reaches)
            if (reach.index >= 0 && static_cast<std::size_t>(reach.index) >= count)
                diagnostics_.warning(reach.where,
                                     reach.what + " is " + std::to_string(reach.index) + ", but " + points + " has " +
                                         std::to_string(count) + " points, counted from 0",
                                     DiagnosticCode("geometry"));
    }
    /// Those of vertices without an index of their own: as many as there are points.
    void checkTangents(const ValidatedNode& node, SourceLocation where) {
        const std::size_t tangents = node.countIn("tangent"), points = node.countIn("coord");
        if (tangents == kNone || points == kNone || node.given.contains("normalIndex")) return;
        const auto perVertex = node.given.find("normalPerVertex");
        const bool ofFaces = node.type->name == "IndexedFaceSet" && perVertex != node.given.end() &&
                             perVertex->second.value.holds<bool>() && !perVertex->second.value.as<bool>();
        if (ofFaces || tangents == 0 || tangents >= points) return;
        const auto index = node.given.find("coordIndex");
        diagnostics_.warning(index == node.given.end() ? where : index->second.where,
                             node.type->name + " has " + std::to_string(tangents) + " tangents for " +
                                 std::to_string(points) + " points",
                             DiagnosticCode("geometry"));
    }
    void checkKeys(const ValidatedNode& node, SourceLocation where) {
        const std::size_t keys = valuesOf(node, {"key"}), values = valuesOf(node, {"keyValue", "easeInEaseOut"});
        if (keys == kNone && values == kNone) return;
        const std::size_t key = keys == kNone ? 0 : keys, value = values == kNone ? 0 : values;
        const auto given = node.given.find(keys == kNone ? "keyValue" : "key");
        const SourceLocation at = given == node.given.end() ? where : given->second.where;
        // Each key of these has a whole list of values.
        const bool lists = node.type->name.starts_with("Coordinate") || node.type->name == "NormalInterpolator";
        if (node.type->findExact("keyValue") == kNoField && node.type->findExact("easeInEaseOut") == kNoField) return;
        const bool isComplete = !node.isConnected || (keys != kNone && values != kNone);  // else a list comes by IS
        if (isComplete && (lists ? (key == 0 ? value != 0 : value % key != 0 || value == 0) : key != value))
            diagnostics_.warning(at,
                                 node.type->name + " has " + std::to_string(key) + " keys and " +
                                     std::to_string(value) + " values" +
                                     (lists ? "; it takes as many times the number of keys as it moves" : ""),
                                 DiagnosticCode("behaviour"));
        const auto k = node.given.find("key");
        if (k != node.given.end() && k->second.value.holds<Array<float>>() &&
            !std::ranges::is_sorted(k->second.value.as<Array<float>>().span()))
            diagnostics_.warning(k->second.where, "the keys of " + node.type->name + " do not ascend",
                                 DiagnosticCode("behaviour"));
    }
    void checkHeights(const ValidatedNode& node) {
        const auto x = node.given.find("xDimension"), z = node.given.find("zDimension"), h = node.given.find("height");
        if (x == node.given.end() || z == node.given.end() || h == node.given.end()) return;
        const std::int64_t wanted =
            std::int64_t{x->second.value.as<std::int32_t>()} * z->second.value.as<std::int32_t>();
        const auto heights = static_cast<std::int64_t>(elementsIn(h->second.value));
        if (heights < wanted)
            diagnostics_.warning(h->second.where,
                                 node.type->name + " has " + std::to_string(heights) + " heights for " +
                                     std::to_string(wanted) + " points (xDimension times zDimension)",
                                 DiagnosticCode("geometry"));
    }
    void checkScript(const ValidatedNode& node) {
        const auto url = node.given.find("url");
        if (!scripts_ || url == node.given.end() || !url->second.value.holds<Array<String>>()) return;
        for (const String& one : url->second.value.as<Array<String>>()) {
            const auto program = programInUrl(one.view());
            if (!program) continue;
            if (const auto fault = scripts_->checkSyntax(std::string(*program))) {
                SourceLocation at = url->second.where;
                at.line += fault->line > 0 ? fault->line - 1 : 0;
                if (fault->line > 1) at.column = 1;
                diagnostics_.warning(at,
                                     "the script of " + (node.def.empty() ? std::string("a Script") : node.def) +
                                         " cannot run: " + fault->text + " (its line " + std::to_string(fault->line) +
                                         ")",
                                     DiagnosticCode("script"));
            }
            return;
        }
    }

    /// A table of the user's has nodes of this component.
    bool isOfDialect(std::string_view component) const {
        return dialect_ && std::ranges::any_of(dialect_->nodeTypes(),
                                               [&](const auto& type) { return type->component == component; });
    }

    Diagnostics& diagnostics_;
    const ScriptLanguage* scripts_;
    std::shared_ptr<const Dialect> dialect_;
    ProfileCheck profile_;
    std::vector<ValidatedNode> open_;
    std::vector<std::unordered_map<std::string, ValidatedNode::Child>> scopes_{1};  // by DEF
    std::map<std::string, bool, std::less<>> protos_;
};

}  // namespace

std::unique_ptr<DocumentHandler> makeValidate(DocumentHandler& next, Diagnostics& diagnostics,
                                              const ScriptLanguage* scripts, std::shared_ptr<const Dialect> dialect) {
    return std::make_unique<Validate>(next, diagnostics, scripts, std::move(dialect));
}

}  // namespace rtsg::detail
