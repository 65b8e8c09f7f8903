// DocumentWords: finds the words of a ClassicVRML or XML document and their roles, for editors.
//
// It accepts any text, complete or not, in one pass, and reports no errors, which readers do. It does not check meaning
// (does the field exist?). Views and offsets refer to the text, which must outlive it. Threading: values. Source:
// ISO/IEC 19776-1 and 19776-2, as far as words go.
#pragma once

#include <cstddef>
#include <string_view>
#include <vector>

namespace rtsg::editor {

enum class WordKind {
    nodeType,    // of a node, of a PROTO instance; `parent` has the field that it stands in
    field,       // of the node `parent`
    value,       // in the field `field` of the node `parent`
    definition,  // of a name: DEF
    use,         // of a name: USE, an end of a ROUTE
    routeField,  // of the node called `field`
    proto,       // a PROTO's or EXTERNPROTO's name where it is declared
    protoUse,    // the same where an instance is made, in XML
    attribute,   // of XML alone, such as DEF, and of statements
};

/// Text nested more deeply than this many brackets or elements has no words.
constexpr std::size_t kDeepestWord = 4096;
constexpr std::size_t kNoNode = static_cast<std::size_t>(-1);

struct Word {
    WordKind kind = WordKind::value;
    std::string_view text;
    std::size_t parent = kNoNode;  // a number of `nodes`
    std::string_view field{};
    std::size_t scope = kNoNode;  // the prototype of `protos` whose body it stands in; names are those of their scope
};

struct WordNode {
    std::string_view type, def;
    std::size_t parent = kNoNode;
    std::string_view field{};  // of the parent; empty where the encoding leaves it out
    std::vector<std::string_view> given{};
    std::size_t scope = kNoNode;  // as of words
    std::size_t end = kNoNode;    // the offset behind it; kNoNode: the text ends before
};

/// The interface of a PROTO or EXTERNPROTO, as far as it is written.
struct WordProto {
    struct Field {
        std::string_view access, type, name;
    };
    std::string_view name;
    std::vector<Field> fields{};
    std::size_t scope = kNoNode;  // as of words
    std::size_t end = kNoNode;    // as of nodes
};

/// The context at the end of the text: the word that the next letter would belong to, and the level around it.
struct WordsEnd {
    enum class Expects { nothing, nodeType, field, value, use, routeField, attribute };
    Expects expects = Expects::nothing;
    std::string_view begun{};  // the part of the word that is there; empty: none
    std::size_t node = kNoNode;
    std::string_view field{};  // of a value; of a routeField: the node's name; of an attribute: the element
};

struct DocumentWords {
    std::vector<Word> words;
    std::vector<WordNode> nodes;
    std::vector<WordProto> protos;
    WordsEnd end;
};

DocumentWords wordsOfClassic(std::string_view text);
DocumentWords wordsOfXml(std::string_view text);
/// Chooses the encoding by the beginning of the text; no words for JSON and others.
DocumentWords wordsOf(std::string_view text);

}  // namespace rtsg::editor
