// Shared by the readers: progress, and checks of values against the spec table.
//
// Threading: one thread a document.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include <rtsg/documents/dialect.h>
#include <rtsg/documents/filter.h>

#include "commands/reader_types.h"
#include "commands/time_limit.h"
#include "text/field_text_parser.h"

namespace rtsg::detail {

class TextFeed;

using ReaderProgress = std::function<void(std::uint64_t done, std::uint64_t total)>;

struct ReaderOptions {
    ReaderProgress progress{};
    Splitting splitting{};
    bool headerless = false;
    bool mustBeHeaded = false;  // refuses what shows no sign of being a scene, without repeating a word of it
    std::uint64_t maximumBytes = std::uint64_t{4} << 30;  // of a text that says nothing of its size
    std::uint64_t maximumMemory = UINT64_MAX;             // that the process takes while it reads
    TimeLimit time{};
    std::string clip{};
    std::shared_ptr<const Dialect> dialect{};  // formats and node types beyond the library's own; null: none
    std::string name{};                        // of the file, as FormatClue has it
};

/// Calls the progress function once per megabyte of input.
class ProgressMeter {
  public:
    ProgressMeter(std::size_t total, const ReaderProgress& progress) : progress_(progress), total_(total) {}
    void at(std::size_t done) {
        if (done < next_ || !progress_) return;
        next_ = done + kStep;
        progress_(done, total_);
    }
    void finish() {
        if (progress_) progress_(total_, total_);
    }

  private:
    static constexpr std::size_t kStep = 1 << 20;
    const ReaderProgress& progress_;
    std::size_t total_, next_ = kStep;
};

/// Describes the fault of a well-formed value: outside the field's range, no allowed word, an axis without direction.
/// Empty if it has none. The value is in the standard's units.
std::string valueComplaint(const FieldDef& field, const Value& value);

/// A comment without white space at either end, and with the line ends of this system.
std::string tidyComment(std::string_view text);

/// Reads one document of the encoding; false if it had to stop early.
bool readClassic(TextFeed& text, DocumentHandler& handler, Diagnostics& diagnostics, const ReaderOptions& options);
/// `utf8`: the text is valid UTF-8; if not, it is in whatever encoding the XML declaration or a BOM names.
bool readXml(TextFeed& text, bool utf8, DocumentHandler& handler, Diagnostics& diagnostics,
             const ReaderOptions& options);
/// A file is read twice, so that only its values are kept; text that can be read only once is kept as a whole.
bool readJson(TextFeed& text, DocumentHandler& handler, Diagnostics& diagnostics, const ReaderOptions& options);

}  // namespace rtsg::detail
