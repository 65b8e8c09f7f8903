// Replaces the geometry nodes of a document by their triangles.
#include <rtsg/session/triangulate.h>

#include <string>
#include <unordered_set>

#include <rtsg/documents/command_list.h>
#include <rtsg/documents/scene_builder.h>

namespace rtsg {

namespace {

/// Finds names that something refers to, in any scope. Too many names do no harm.
class NameScan final : public Filter {
  public:
    std::unordered_set<std::string> linked, used;

    void useNode(std::string_view def, std::string_view, SourceLocation) override { used.emplace(def); }
    void route(std::string_view from, std::string_view, std::string_view to, std::string_view,
               SourceLocation) override {
        linked.emplace(from);
        linked.emplace(to);
    }
    void importNode(std::string_view, std::string_view, std::string_view local, SourceLocation) override {
        linked.emplace(local);
    }
    void exportNode(std::string_view local, std::string_view, SourceLocation) override { linked.emplace(local); }
};

/// Holds a geometry node back until it is complete.
class Rewrite final : public Filter {
  public:
    Rewrite(DocumentHandler& next, const NameScan& names, Diagnostics& diagnostics, const TessellationOptions& options)
        : Filter(next), next_(next), names_(names), diagnostics_(diagnostics), options_(options) {}

    void beginNode(std::string_view type, std::string_view def, std::string_view field, SourceLocation where) override {
        if (depth_ == 0) {
            const NodeType* known = protos_.contains(std::string(type)) ? nullptr : findBuiltinType(type);
            const bool takes = field == "geometry" && known && known->isA("X3DGeometryNode") &&
                               type != "IndexedTriangleSet" && !names_.linked.contains(std::string(def));
            if (!takes) return Filter::beginNode(type, def, field, where);
            held_ = {};
            mustStay_ = false;
            def_ = def;
        } else if (const std::string name(def); names_.linked.contains(name) || names_.used.contains(name)) {
            mustStay_ = true;
        }
        ++depth_;
        held_.beginNode(type, def, field, where);
    }
    void endNode(SourceLocation where) override {
        if (depth_ == 0) return Filter::endNode(where);
        held_.endNode(where);
        if (--depth_ == 0 && (mustStay_ || !sendTriangles(where))) held_.replay(next_);
    }
    void useNode(std::string_view def, std::string_view field, SourceLocation where) override {
        if (depth_ == 0) return Filter::useNode(def, field, where);
        mustStay_ = true;  // a node that uses others stays as it is, for the same reason
        held_.useNode(def, field, where);
    }
    void setField(std::string_view name, Value value, SourceLocation where) override {
        if (depth_ == 0) return Filter::setField(name, std::move(value), where);
        held_.setField(name, std::move(value), where);
    }
    void isConnection(std::string_view nodeField, std::string_view protoField, SourceLocation where) override {
        if (depth_ == 0) return Filter::isConnection(nodeField, protoField, where);
        mustStay_ = true;
        held_.isConnection(nodeField, protoField, where);
    }
    void comment(std::string_view text, SourceLocation where) override {
        if (depth_ == 0) return Filter::comment(text, where);
        held_.comment(text, where);
    }
    void beginProto(std::string_view name, SourceLocation where) override {
        protos_.emplace(name);
        Filter::beginProto(name, where);
    }
    void externProto(std::string_view name, const std::vector<FieldDeclaration>& fields,
                     const std::vector<std::string>& url, SourceLocation where) override {
        protos_.emplace(name);
        Filter::externProto(name, fields, url, where);
    }

  private:
    /// Returns false, and sends nothing, for geometry without triangles.
    bool sendTriangles(SourceLocation where) {
        Scene scene;
        Diagnostics unheard;  // the reader has reported invalid values
        BuildOptions options;
        options.resources = Resources();
        SceneBuilder builder(scene, unheard, options);
        builder.beginDocument({});
        builder.beginNode("Shape", {}, {}, where);
        held_.replay(builder);
        builder.endNode(where);
        builder.endDocument();
        if (builder.roots().empty()) return false;
        const Node& shape = scene.node(builder.roots().front());
        const NodeId geometry = *static_cast<const NodeId*>(shape.storage(shape.type().findExact("geometry")));
        const auto mesh = tessellate(scene, geometry, options_);
        if (!mesh || (*mesh)->empty()) return false;
        for (const Diagnostic& one : (*mesh)->diagnostics.all())
            diagnostics_.add(one.severity, where, one.text, one.code);
        send(**mesh, where);
        return true;
    }
    void send(const Mesh& mesh, SourceLocation where) {
        VertexArrays arrays = vertexArrays(mesh);
        Array<std::int32_t> index;
        index.resize(arrays.triangles.size());
        for (std::size_t i = 0; i < index.size(); ++i)
            index.mutableData()[i] = static_cast<std::int32_t>(arrays.triangles[i]);
        next_.beginNode("IndexedTriangleSet", def_, "geometry", where);
        if (!mesh.solid) next_.setField("solid", Value(false), where);
        next_.setField("index", Value(std::move(index)), where);
        const auto property = [&](const char* type, const char* field, const char* values, Value value) {
            next_.beginNode(type, {}, field, where);
            next_.setField(values, std::move(value), where);
            next_.endNode(where);
        };
        property("Coordinate", "coord", "point", Value(std::move(arrays.positions)));
        property("Normal", "normal", "vector", Value(std::move(arrays.normals)));
        if (!arrays.texCoords.empty())
            property("TextureCoordinate", "texCoord", "point", Value(std::move(arrays.texCoords)));
        if (!arrays.colors.empty()) property("ColorRGBA", "color", "color", Value(std::move(arrays.colors)));
        next_.endNode(where);
    }

    DocumentHandler& next_;
    const NameScan& names_;
    Diagnostics& diagnostics_;
    const TessellationOptions options_;
    std::unordered_set<std::string> protos_;
    CommandList held_;
    std::size_t depth_ = 0;  // depth within the geometry that is held back
    bool mustStay_ = false;
    std::string def_;
};

struct Recorded {
    CommandList commands;
};

class Triangulate final : private Recorded, public Filter {
  public:
    Triangulate(DocumentHandler& next, Diagnostics& diagnostics, const TessellationOptions& options)
        : Filter(commands), next_(next), diagnostics_(diagnostics), options_(options) {}

    void endDocument() override {
        Filter::endDocument();
        NameScan names;
        commands.replay(names);
        Rewrite rewrite(next_, names, diagnostics_, options_);
        commands.replay(rewrite);
    }

  private:
    DocumentHandler& next_;
    Diagnostics& diagnostics_;
    const TessellationOptions options_;
};

}  // namespace

Result<std::unique_ptr<DocumentHandler>> makeTriangulate(DocumentHandler& next, Diagnostics& diagnostics,
                                                         const TessellationOptions& options) {
    return std::make_unique<Triangulate>(next, diagnostics, options);
}

}  // namespace rtsg
