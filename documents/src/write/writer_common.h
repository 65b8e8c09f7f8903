// Shared by the writers: buffered output, and values laid out over lines.
//
// Threading: one thread a writer.
#pragma once

#include <functional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <rtsg/core/field_text.h>
#include <rtsg/documents/writer.h>

#include "commands/reader_types.h"
#include "commands/spelled_name.h"
#include "commands/value_numbers.h"
#include "text/field_text_printer.h"

namespace rtsg::detail {

/// Bytes of text at which a writer hands over its buffer.
constexpr std::size_t kFlushAt = 1 << 16;

/// Appends a value; an MF value that does not fit one line is broken into lines that start at `indent` spaces. XML text
/// is not escaped yet. `full` is called every so often within long values, and may empty `out`.
void appendWrapped(std::string& out, const Value& value, TextSyntax syntax, std::size_t indent,
                   const std::function<void()>& full = {});

/// Columns of an indent; a bounded number, or deep nesting would cost the square of its depth.
constexpr std::size_t spaces(std::size_t levels) {
    return 2 * (levels < 40 ? levels : 40);
}

/// Names that nodes are used by before there is such a node, of which XML and JSON cannot say the type; those that an
/// IMPORT gives are none of them. They are told at the end, since an IMPORT may stand anywhere.
class UnknownUses {
  public:
    void use(std::string_view def, SourceLocation where) { uses_.push_back({std::string(def), where}); }
    void import(std::string_view local) { imported_.emplace(local); }
    void report(Diagnostics& diagnostics) const {
        for (const auto& [def, where] : uses_)
            if (!imported_.contains(def))
                diagnostics.error(where,
                                  "USE '" + def +
                                      "': no node has that name before this point; of which type it is cannot be "
                                      "written");
    }

  private:
    std::vector<std::pair<std::string, SourceLocation>> uses_;
    std::set<std::string, std::less<>> imported_;
};

/// The version to write: the header's, if it is one of X3D.
std::string x3dVersion(const DocumentHeader& header);

std::string_view accessWord(Access access, bool vrml97);

std::unique_ptr<DocumentHandler> makeClassicWriter(TextSink sink, Diagnostics& diagnostics, bool vrml97);
std::unique_ptr<DocumentHandler> makeXmlWriter(TextSink sink, Diagnostics& diagnostics);
std::unique_ptr<DocumentHandler> makeJsonWriter(TextSink sink, Diagnostics& diagnostics);

}  // namespace rtsg::detail
