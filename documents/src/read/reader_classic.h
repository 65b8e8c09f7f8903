// Reader of ClassicVRML (#X3D Vn utf8) and VRML97 (#VRML V2.0 utf8): text in, document commands out.
//
// Invariant: an explicit stack, never recursion; each byte is looked at a bounded number of times; commands to the
// handler nest whatever the input. After an error reading goes on at the next place that makes sense: behind the value,
// the unknown node's braces, or the stray token. A megabyte of text is kept behind the place of reading, and as much
// before it as a token needs: no pointer into the text outlives its statement. Threading: one thread a document.
// Source: ISO/IEC 19776-2 V3.3 annex A; ISO/IEC 14772-1:1997 annex A. Both dialects' keywords are taken in either.
#pragma once

#include <optional>
#include <set>

#include "commands/spelled_name.h"
#include "commands/units.h"
#include "reader_common.h"
#include "text/text_position.h"
#include "text_feed.h"

namespace rtsg::detail {

class ClassicReader final : private FieldTextReport {
  public:
    ClassicReader(TextFeed& text, DocumentHandler& handler, Diagnostics& diagnostics, const ReaderOptions& options);
    bool read();

  private:
    enum class Inside : std::uint8_t { interface, body, node, list };
    struct Frame {
        Inside inside;
        NodeShape shape;                   // node
        std::shared_ptr<ProtoType> proto;  // interface, body
        std::string_view field;            // list: where its nodes go
        FieldRef into;                     // list
        SourceLocation open;
        GivenFields given{};                        // node
        std::set<std::string_view> unknownGiven{};  // node of unknown type: the fields that had values
    };

    // reader_classic.cpp: the document and its statements
    bool readHeader();
    void readProfile();
    void closeAll();
    void statement();
    void keywordStatement(std::string_view keyword);
    void route();
    bool routeEnd(std::string_view& node, std::string_view& field);
    void importStatement();
    void exportStatement();
    void component();
    void meta();
    void unit();
    void beginProto();
    void externProto();
    void interfaceItem();
    void endInterface();

    // reader_classic_node.cpp: nodes, fields, declarations
    void nodeItem();
    void listItem();
    void fieldItem(std::string_view name, const char* at);
    void unknownField(std::string_view name, const char* at, const std::string& ifNoNodes = {});
    bool nodesFollow();
    void keepText(std::string_view name, const char* where, const char* start, bool isList);
    bool startsNode();
    void nodeStatement(const FieldRef& into);
    void beginNode(std::string_view type, std::string_view def, const FieldRef& into, const char* at);
    void useNode(const FieldRef& into, const char* at);
    void nodeValue(const FieldRef& field, const char* at);
    void openList(const FieldRef& field);
    void checkPosition(const FieldRef& into, const NodeShape& shape, const char* at);
    bool declaration(FieldDeclaration& out, const char*& at, bool& recognised);
    void declare(DeclaredFields& fields, const NodeShape* node);
    void closeBracket();
    NodeShape nodeBehind(std::string_view next);
    std::string ofUnclosed(std::string_view field) const;
    void nodeWithoutField(const NodeShape& node, const char* where);

    // tokens
    void skipSpace();
    std::string_view word();
    /// A word that is a name, without its escapes.
    std::string_view name(std::string_view word) {
        return mayBeSpelled(word) ? kept(readName(word, Spelling::classic)) : word;
    }
    std::string_view name() { return name(word()); }
    std::string_view peekWord();
    bool peekIs(char c) {
        skipSpace();
        return p_ != end_ && *p_ == c;
    }
    void skipValue();
    bool startsItem(std::string_view next) const;
    void skipBalanced();
    bool parseValue(FieldType type, Value& out, const CustomType* custom = nullptr);
    void stray();
    SourceLocation at(const char* p) { return position_.of(p); }
    void error(const char* where, std::string text) { report(Severity::error, where, std::move(text)); }
    void report(Severity severity, const char* where, std::string text) override;
    void comment(std::string_view line) override;
    void reportComment();
    void reportHeld();  // comments that were met before the document began, or while holdsText_
    void progress(const char* p) override;
    const char* more(const char* end) override;
    Splitting splitting() const override { return splitting_; }
    /// A copy of a name in the text that stays.
    std::string_view kept(std::string_view text) { return *names_.emplace(text).first; }

    void push(Frame frame);
    void pop();
    void mute();
    void beganNode(const NodeShape& shape);

    TextFeed& feed_;
    const char* p_;
    const char* end_;
    const char* released_;  // text before it is released
    DocumentHandler* handler_;
    DocumentHandler* loud_;  // the real one, while muted
    Filter silent_;
    std::size_t mutedAt_ = kNotMuted;  // frames below this depth are silent
    static constexpr std::size_t kLongestHeader = 1 << 12;
    bool holdsText_ = false;  // the value being read is wanted as text
    static constexpr std::size_t kNotMuted = ~std::size_t{0};
    Diagnostics& diagnostics_;
    TextPosition position_;
    ProgressMeter meter_;
    ReaderTypes types_;
    std::set<std::string, std::less<>> names_;  // of fields that nodes do not have
    const char* valueEnd_ = nullptr;            // of skipValue()
    const char* reported_ = nullptr;            // the end of the last comment
    std::vector<Frame> frames_;
    std::size_t lists_ = 0;  // open lists since the innermost prototype began
    std::vector<std::size_t> outerLists_;
    std::size_t bodies_ = 0;  // PROTO bodies open
    DocumentHeader header_;
    bool vrml97_ = false;
    bool began_ = false;                  // the handler has been told of the document
    std::optional<std::string> comment_;  // lines read and not told yet
    const char *commentStart_ = nullptr, *commentEnd_ = nullptr;
    std::vector<std::pair<std::string, SourceLocation>> early_;  // comments before the document begins,
                                                                 // or read together with a value that comes first
    Units units_;
    const Splitting splitting_;
    const bool headerless_;  // the header's line may be missing
};

/// The access that a keyword of either dialect stands for; false if it is none.
bool accessFromKeyword(std::string_view keyword, Access& out);

}  // namespace rtsg::detail
