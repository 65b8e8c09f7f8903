// Reader of the XML encoding, on expat: elements in, document commands out.
//
// Invariant: an explicit stack, never recursion; commands to the handler nest whatever the input. Entities declared in
// the document are refused (they can blow up), external ones are never fetched, attribute defaults of a DTD ignored.
// XML that is not well-formed ends the reading there. Threading: one thread a document.
// Source: ISO/IEC 19776-1 V3.3. Laxer: a child whose containerField does not fit its parent goes where it fits.
#pragma once

#include <expat.h>

#include "reader_common.h"
#include "reader_position.h"

namespace rtsg::detail {

class XmlReader final : private FieldTextReport {
  public:
    XmlReader(std::string_view text, bool utf8, DocumentHandler& handler, Diagnostics& diagnostics,
              const ReaderProgress& progress);
    ~XmlReader() override;
    XmlReader(const XmlReader&) = delete;
    XmlReader& operator=(const XmlReader&) = delete;
    bool read();

  private:
    enum class Inside : std::uint8_t {
        root,
        head,
        scene,
        node,
        protoDeclare,
        interface,
        body,
        externProto,
        declaration,
        value,
        is,
        leaf
    };
    /// What a Script or shader holds back until it is clear: fields that an IS may follow, and its source text.
    struct Source {
        std::vector<std::pair<FieldDeclaration, std::optional<Value>>> fields;
        std::unordered_map<std::string, std::vector<std::string>> connections;  // to fields not declared yet
        std::optional<Array<String>> url;
        SourceLocation where;
        std::string text;
        bool hasSection = false;  // CDATA was seen: white space around it is layout
    };
    struct Prototype {
        std::shared_ptr<ProtoType> type;
        std::vector<std::string> url;
        bool hasBody = false;
    };
    struct Frame {
        Inside inside;
        NodeShape shape;                             // node
        GivenFields given;                           // node
        std::unique_ptr<Source> source;              // node: Script or shader
        std::unique_ptr<Prototype> prototype;        // protoDeclare, externProto
        FieldRef into;                               // declaration, value
        std::unique_ptr<FieldDeclaration> declared;  // declaration not told yet
        std::string element;
        SourceLocation open;
        bool hasChildren = false;
    };
    using Attributes = const char**;
    using Handle = void (XmlReader::*)(Attributes);
    struct Element {
        std::string_view name;
        Handle handle;
    };

    // reader_xml.cpp: document, statements, prototypes
    void start(const char* name, Attributes attributes);
    void end();
    void beginSection();
    void text(std::string_view characters);
    static const Element* findElement(std::string_view name);
    void begin(Attributes attributes);
    void closeAll();
    void startRoot(Attributes attributes);
    void startHead(Attributes attributes);
    void startScene(Attributes attributes);
    void startMeta(Attributes attributes);
    void startComponent(Attributes attributes);
    void startUnit(Attributes attributes);
    void startRoute(Attributes attributes);
    void startImport(Attributes attributes);
    void startExport(Attributes attributes);
    void startProtoDeclare(Attributes attributes);
    void startExternProto(Attributes attributes);
    void startInterface(Attributes attributes);
    void startBody(Attributes attributes);
    void endProto(Frame& frame);

    // reader_xml_node.cpp: nodes, fields, declarations
    void startNode(const char* name, Attributes attributes);
    void startInstance(Attributes attributes);
    void openNode(NodeShape shape, Attributes attributes);
    void useNode(std::string_view use, const NodeShape& shape, std::string_view field, const FieldRef& into);
    void nodeAttributes(Attributes attributes);
    void setAttribute(const char* name, const char* value);
    FieldRef placeFor(const NodeShape& child, const char* containerField, bool& fits);
    void startField(Attributes attributes);
    void startFieldValue(Attributes attributes);
    void startIs(Attributes attributes);
    void startConnect(Attributes attributes);
    void tellDeclaration(Frame& frame);
    void tellFields(Frame& node);
    void endNode(Frame& frame);

    // helpers
    const char* attribute(Attributes attributes, std::string_view name) const;
    bool parseAttribute(const char* name, const char* value, FieldType type, Value& out);
    void push(Inside inside);
    void pop();
    void mute();
    void skip(std::string why);
    /// May ROUTE, PROTO and the like stand here?
    bool takesStatements() const {
        return frames_.empty() || isTop(Inside::root) || isTop(Inside::scene) || isTop(Inside::body) ||
               isTop(Inside::node);
    }
    bool isTop(Inside inside) const { return !frames_.empty() && frames_.back().inside == inside; }
    SourceLocation where();
    SourceLocation locate(const char* at);
    void error(std::string text) { diagnostics_.error(where(), std::move(text)); }
    void report(Severity severity, const char* at, std::string text) override;

    std::string_view text_;
    bool utf8_;
    DocumentHandler* handler_;
    DocumentHandler* loud_;
    NullHandler silent_;
    static constexpr std::size_t kNotMuted = ~std::size_t{0};
    std::size_t mutedAt_ = kNotMuted;
    Diagnostics& diagnostics_;
    TextPosition position_;
    ProgressMeter meter_;
    ReaderTypes types_;
    std::vector<Frame> frames_;
    std::size_t skipDepth_ = 0;  // elements open inside one that is left out
    std::size_t bodies_ = 0;     // PROTO bodies open
    bool inSection_ = false;     // between <![CDATA[ and ]]>
    bool began_ = false, refusedEntity_ = false, hasUnits_ = false;
    const char* element_ = "";
    const char* attributeName_ = nullptr;  // whose value is being parsed
    const char* attributeValue_ = nullptr;
    int specified_ = 0;  // attributes in the text, as opposed to defaults from a DTD (expat's count: two each)
    XML_Parser parser_;
};

}  // namespace rtsg::detail
