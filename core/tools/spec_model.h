// Model of the node tables (*.x3dspec): what the parser reads, what the emitter writes.
//
// For the host tool of the build, and for tables that are read at run time: plain standard C++, no dependency on the
// library it generates code for.
// The notation is described in core/spec/README.md.
#pragma once

#include <functional>
#include <limits>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace spec {

struct Position {
    std::string file;
    int line = 0;
};

struct Field {
    Position where;
    std::string type;    // "SFVec3f"; "SFCustom" for those that the tables declare
    std::string custom;  // which that is: "Quantity float64 2", as the line `fieldType` says; else empty
    std::string access;  // "inputOutput", ...
    std::string name;
    /// Numbers and TRUE/FALSE separated by one space; strings each followed by a newline; empty for nodes.
    std::string defaultText;
    std::string aspect;
    std::string allowed;  // strings, each followed by a newline
    std::string accepts;  // type names separated by '|'
    double min = -std::numeric_limits<double>::infinity();
    double max = std::numeric_limits<double>::infinity();
    bool exclusiveMin = false, exclusiveMax = false, hidden = false;
    std::string unit;  // "length", ..., "none"; empty if not stated
    int since = 0;     // ten times the version; 0: that of the node
};

/// The tags of a field after its constraint, or in a retag; empty (0) if not stated.
struct FieldTags {
    std::string aspect, unit;
    int since = 0;
};

struct Retag {
    Position where;
    std::vector<std::string> fields;
    FieldTags tags;
};

struct FieldTypeLine {
    std::string text;  // as Field::custom
    int line = 0;
};

/// The tags of a type. Each is inherited by types that do not state it.
struct Tags {
    std::string acts;  // "never", "onInput", "always"; empty if not stated
    bool writesInputs = false;
    std::string role;                // empty if not stated
    std::vector<std::string> below;  // the role's: fields whose nodes hang below in the hierarchy
};

struct Type {
    Position where;
    std::string name, component, container;
    std::vector<std::string> bases;
    int level = 1;
    int since = 30;  // ten times the version of X3D that has it first; 20 is VRML97
    bool isAbstract = false;
    bool hidden = false;    // not creatable from files
    bool imported = false;  // from --import: known, but not written out
    Tags tags;
    std::vector<Field> own;
    std::vector<Retag> retags;

    // Filled by Model::resolve().
    std::vector<Field> fields;            // public ones by name, then hidden ones as written
    std::vector<std::string> implements;  // every abstract ancestor, nearest first
    Tags all;                             // its own, then its ancestors'
    int state = 0;                        // 0 untouched, 1 being resolved, 2 done
};

/// Everything read so far. Errors are reported and counted; the parser reports only the first of a line.
class Model {
  public:
    using Report = std::function<void(const Position& where, const std::string& text)>;
    /// Without a function errors go to stderr as `file:line: error: text`.
    explicit Model(Report report = {}) : report_(std::move(report)) {}
    void parse(const std::string& file, const std::string& text, bool imported);
    /// Inherits fields, applies retags and extensions, checks every name; call once after the last parse().
    void resolve();
    void error(const Position& where, const std::string& text);

    int errors() const { return errors_; }
    /// Those that `fieldType` lines have declared, by name.
    const std::map<std::string, FieldTypeLine, std::less<>>& fieldTypes() const { return fieldTypes_; }
    /// In order of reading.
    const std::vector<Type>& types() const { return types_; }
    const Type* find(std::string_view name) const;

  private:
    struct Token;
    std::vector<Token> tokens(const Position& where, std::string_view line);
    void parseHead(const Position& where, const std::vector<Token>& tokens, bool imported);
    void parseTag(Type& type, const std::vector<Token>& tokens, std::size_t& next);
    void parseFieldType(const Position& where, const std::vector<Token>& tokens);
    bool isFieldType(const std::string& name) const;
    void parseField(const Position& where, const std::vector<Token>& tokens);
    bool parseFieldTags(const Position& where, std::vector<Token>& tokens, FieldTags& tags);
    bool parseSince(const Position& where, const std::string& version, int& since);
    void checkUnit(const Position& where, const Field& field);
    void parseDefault(Field& field, const std::vector<Token>& tokens, std::size_t& next);
    void parseGroup(Field& field, const std::string& group);
    void checkDefault(const Field& field);
    void resolve(Type& type);
    void inherit(Type& type, const Type& base);
    void inheritTags(Type& type);
    void checkTags(const Type& type);
    Type* lookup(std::string_view name);

    Report report_;
    std::vector<Type> types_;
    std::map<std::string, std::size_t, std::less<>> byName_;
    std::map<std::string, FieldTypeLine, std::less<>> fieldTypes_;  // by name: "Quantity"
    struct Extension {
        Position where;
        std::string name;
        std::vector<Field> own;
        bool imported = false;
    };
    std::vector<Extension> extensions_;
    std::string component_;
    std::vector<Field>* open_ = nullptr;  // where the next field line belongs
    Type* openType_ = nullptr;
    int errors_ = 0;
    bool parsing_ = false;
    int errorLine_ = 0;  // of the file being parsed, where the last error was
};

/// Numbers in one element of an SF or MF type; 0 for String, Node, Image and Custom; -1 for no field type at all.
int componentsOf(std::string_view type);
/// "std::int32_t", "::rtsg::Array<::rtsg::Vec3f>", ...
std::string cppType(std::string_view type);

}  // namespace spec
