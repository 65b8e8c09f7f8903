// Turns elements with attributes into document commands; shared by the XML and the JSON reader.
//
// Invariant: an explicit stack, never recursion; commands to the handler nest whatever the input. Threading: one thread
// a document. Source: ISO/IEC 19776-1 V3.3. Laxer: a child without containerField
// goes where it fits; a node that fits nowhere is kept with its name, and with a warning, outside of its parent's
// fields.
#pragma once

#include "commands/held_script.h"
#include "commands/units.h"
#include "reader_common.h"

namespace rtsg::detail {

class ElementReader : private FieldTextReport {
  public:
    /// Null-terminated names and values in turn, as expat hands them out; valid during start() only.
    using Attributes = const char**;

  protected:
    ElementReader(Encoding encoding, DocumentHandler& handler, Diagnostics& diagnostics,
                  std::shared_ptr<const Dialect> dialect);

    /// `specified`: how many strings of `attributes` count (a DTD's defaults are behind them).
    void start(const char* name, Attributes attributes, int specified);
    void end();
    void beginSection();
    void endSection() { inSection_ = false; }
    void text(std::string_view characters);
    void comment(std::string_view text) override;
    /// Closes all open elements. False if there was no element at all.
    bool finish();

    /// The place of the element that starts, or of the end that is being read.
    virtual SourceLocation where() = 0;
    /// The place of `at`, which is in the value of the attribute being parsed.
    virtual SourceLocation locate(const char* at) = 0;
    /// A value that was parsed before its element began, since it is too long to be an attribute's text; null if `text`
    /// is a value's text. Its place is where() then.
    virtual Value* parsedBefore(const char* /*text*/) { return nullptr; }
    /// The type of an attribute of an element that would begin here, if it is one of many numbers; else SFNode.
    FieldType longAttribute(std::string_view element, std::string_view name, std::string_view fieldName) const;
    const char* parsedAttribute() const { return attributeName_; }
    const char* parsedValue() const { return attributeValue_; }
    std::string openElement() const { return frames_.empty() ? std::string() : frames_.back().element; }
    void error(std::string text) { diagnostics_.error(where(), std::move(text)); }
    Diagnostics& diagnostics() { return diagnostics_; }

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
    /// The source text of a Script or shader, and the connections of the fields that it declares.
    struct Source {
        static constexpr std::size_t kNotHeld = ~std::size_t{0};
        std::size_t number = kNotHeld;  // among the nodes of held_
        HeldScript::Connections connections;
        std::optional<Array<String>> url;
        SourceLocation where;
        std::string text;
        bool hasSection = false;  // CDATA was seen: white space around it is layout
    };
    struct Prototype {
        std::shared_ptr<ProtoType> type;
        std::vector<std::string> url;
        std::shared_ptr<const Documentation> about;  // of an EXTERNPROTO, until it is told
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
    using Handle = void (ElementReader::*)(Attributes);
    struct Element {
        std::string_view name;
        Handle handle;
    };

    // reader_element.cpp: document, statements, prototypes
    static const Element* findElement(std::string_view name);
    void begin(Attributes attributes);
    void startRoot(Attributes attributes);
    void startHead(Attributes attributes);
    void startScene(Attributes attributes);
    void startMeta(Attributes attributes);
    void startComponent(Attributes attributes);
    void startUnit(Attributes attributes);
    void startRoute(Attributes attributes);
    void startImport(Attributes attributes);
    void startExport(Attributes attributes);
    std::shared_ptr<const Documentation> documentation(Attributes attributes) const;
    void startProtoDeclare(Attributes attributes);
    void startExternProto(Attributes attributes);
    void startInterface(Attributes attributes);
    void startBody(Attributes attributes);
    void endExternProto(Frame& frame);
    void endProto(Frame& frame);

    // reader_element_node.cpp: nodes, fields, declarations
    void startNode(const char* name, Attributes attributes);
    void startInstance(Attributes attributes);
    void openNode(NodeShape shape, Attributes attributes);
    void useNode(std::string_view use, const NodeShape& shape, std::string_view field, const FieldRef& into);
    void nodeAttributes(Attributes attributes);
    void setAttribute(const char* name, const char* value);
    FieldRef fieldFor(const NodeShape& child, const char* containerField, bool& fits);
    FieldRef fieldIn(const NodeShape& parent, const NodeShape& child, const char* containerField);
    void startField(Attributes attributes);
    void startFieldValue(Attributes attributes);
    void startIs(Attributes attributes);
    void startConnect(Attributes attributes);
    void reportDeclaration(Frame& frame);
    void reportConnections(Frame& frame);
    void endNode(Frame& frame);

    // helpers
    const char* attribute(Attributes attributes, std::string_view name) const;
    bool parseAttribute(const char* name, const char* value, FieldType type, Value& out,
                        const CustomType* custom = nullptr);
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
    void report(Severity severity, const char* at, std::string text) override;

    DocumentHandler* handler_;
    DocumentHandler* loud_;
    std::unique_ptr<HeldScript> held_;  // the outermost open Script of a PROTO's body, which hears all that is in it
    Filter silent_;
    static constexpr std::size_t kNotMuted = ~std::size_t{0};
    std::size_t mutedAt_ = kNotMuted;
    Diagnostics& diagnostics_;
    Encoding encoding_;
    bool plainStrings_;  // an SFString has no escapes
    ReaderTypes types_;
    std::vector<Frame> frames_;
    std::size_t skipDepth_ = 0;  // elements open inside one that is left out
    std::size_t bodies_ = 0;     // PROTO bodies open
    bool inSection_ = false;     // between <![CDATA[ and ]]>
    bool began_ = false;
    std::vector<std::pair<std::string, SourceLocation>> early_;  // comments before the root element
    Units units_;
    const char* element_ = "";
    const char* attributeName_ = nullptr;  // whose value is being parsed
    const char* attributeValue_ = nullptr;
    int specified_ = 0;  // attributes in the text, as opposed to defaults from a DTD
};

}  // namespace rtsg::detail
