// The stream of commands between readers, filters, writers and the SceneBuilder (the paper's beginDocument,
// beginNode, endNode). A reader pushes; whatever implements DocumentHandler consumes; no scene is needed.
//
// Invariant: begin/end calls nest; every value arrives typed and complete; names are the spec's field names
// without set_ or _changed. Order within a node is the file's order. Readers have already reported and left
// out what they could not parse, so a handler sees only well-formed commands; meaning (does DEF exist, do the
// types of a ROUTE agree) is checked by the SceneBuilder. Threading: one thread a stream.
// Source: RTSG paper 3.1; ISO/IEC 19775-1 V4.0 clause 4.4, 7.2.5.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/node_type.h>

namespace rtsg {

enum class Encoding : std::uint8_t { xml, classicVrml, vrml97, json, binary };

struct DocumentHeader {
    Encoding encoding = Encoding::classicVrml;
    std::string version = "4.0";  // "2.0" for VRML97
    std::string profile{};        // empty if the document names none
    /// True if, in each node that is no Script or shader, all values that are no nodes come before its first child:
    /// then a writer need not wait for more of them.
    bool valuesFirst = false;
    SourceLocation where{};  // position of the profile, or of the place where it is missing
};

/// The statements of a document about itself that come before its nodes (7.2.5).
struct DocumentHead {
    struct Component {
        std::string name;
        int level = 1;
    };
    struct Meta {
        std::string name, content;
    };
    struct Unit {
        std::string category, name;
        double conversionFactor = 1;
    };
    std::string profile;  // empty if the document names none
    std::vector<Component> components;
    std::vector<Meta> meta;
    std::vector<Unit> units;
};

/// An author's remarks on a declaration (19776-1: the attributes appinfo and documentation).
struct Documentation {
    std::string appinfo, documentation;
};

/// An interface declaration of a PROTO, EXTERNPROTO, Script or shader.
struct FieldDeclaration {
    Access access = Access::inputOutput;
    FieldType type = FieldType::SFBool;
    std::string name;
    std::shared_ptr<const Documentation> about{};  // null if there are no remarks
    std::shared_ptr<const CustomType> custom{};    // the type, for SFCustom and MFCustom
};

class DocumentHandler {
  public:
    virtual ~DocumentHandler() = default;

    virtual void beginDocument(const DocumentHeader& header) = 0;
    virtual void endDocument() = 0;
    virtual void component(std::string_view name, int level, SourceLocation where) = 0;
    virtual void meta(std::string_view name, std::string_view content, SourceLocation where) = 0;
    virtual void unit(std::string_view category, std::string_view name, double conversionFactor,
                      SourceLocation where) = 0;

    /// Opens a node. `def` may be empty. `field` is the field of the enclosing node (or declared field of a
    /// PROTO interface) that it goes into; at the top level of a document or PROTO body it is empty.
    virtual void beginNode(std::string_view type, std::string_view def, std::string_view field,
                           SourceLocation where) = 0;
    virtual void endNode(SourceLocation where) = 0;
    virtual void useNode(std::string_view def, std::string_view field, SourceLocation where) = 0;
    /// Sets a field of the open node. Node-valued fields come as beginNode/useNode; an SFNode NULL or an empty MFNode
    /// comes as a Value.
    virtual void setField(std::string_view name, Value value, SourceLocation where) = 0;
    /// Inside a Script, shader or PROTO interface; nodes for a node-valued default follow as beginNode(..., name).
    virtual void declareField(const FieldDeclaration& field, std::optional<Value> value, SourceLocation where) = 0;
    /// `nodeField IS protoField` in the open node of a PROTO body.
    virtual void isConnection(std::string_view nodeField, std::string_view protoField, SourceLocation where) = 0;

    /// beginProto declareField* beginProtoBody (nodes, routes, nested protos)* endProto
    virtual void beginProto(std::string_view name, SourceLocation where) = 0;
    virtual void beginProtoBody(SourceLocation where) = 0;
    virtual void endProto(SourceLocation where) = 0;
    virtual void externProto(std::string_view name, const std::vector<FieldDeclaration>& fields,
                             const std::vector<std::string>& url, SourceLocation where) = 0;

    virtual void route(std::string_view fromNode, std::string_view fromField, std::string_view toNode,
                       std::string_view toField, SourceLocation where) = 0;
    virtual void importNode(std::string_view inlineDef, std::string_view exportedName, std::string_view localName,
                            SourceLocation where) = 0;
    virtual void exportNode(std::string_view localName, std::string_view exportedName, SourceLocation where) = 0;

    /// A comment without its delimiters and without white space at either end. Comments within a value come before the
    /// value.
    virtual void comment(std::string_view text, SourceLocation where);
    /// Remarks on the PROTO or EXTERNPROTO that comes next.
    virtual void documentation(const Documentation& about, SourceLocation where);

    /// Whether all further commands would be left out because of a limit, which was reported; a reader may then stop.
    virtual bool isFull() const;
};

inline void DocumentHandler::comment(std::string_view, SourceLocation) {}
inline void DocumentHandler::documentation(const Documentation&, SourceLocation) {}
inline bool DocumentHandler::isFull() const {
    return false;
}

/// The components and profiles that this build knows: a component with the highest level of any node in it, a profile
/// with its components. Source: ISO/IEC 19775-1 V4.0, annexes A to H.
struct Profile {
    std::string name;
    std::vector<DocumentHead::Component> components;
};
std::vector<DocumentHead::Component> supportedComponents();
std::vector<Profile> supportedProfiles();

}  // namespace rtsg
