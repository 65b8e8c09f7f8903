// The formats that files can be read in: the library's own and those of a dialect, found by name and content.
//
// Threading: one thread a document. Source: RTSG paper 3.1.
#pragma once

#include <span>

#include <rtsg/documents/dialect.h>

#include "import/import.h"
#include "reader_common.h"
#include "text_feed.h"

namespace rtsg::detail {

/// A file that is fetched as it is needed. The readers of texts take the feed; those of other files take all its bytes.
class FeedSource final : public FormatSource {
  public:
    FeedSource(TextFeed& feed, const OpenBeside& beside, const ReaderOptions& options, Diagnostics& diagnostics)
        : feed_(feed), beside_(beside), options_(options), diagnostics_(diagnostics) {}
    std::string_view name() const override { return options_.name; }
    std::string_view bytes() override;
    Result<std::string> beside(std::string_view url) const override;
    std::string_view clip() const override { return options_.clip; }
    std::uint64_t maximumBytes() const override { return options_.maximumBytes; }

    TextFeed& feed() { return feed_; }
    const OpenBeside& openBeside() const { return beside_; }
    const ReaderOptions& options() const { return options_; }
    /// Reports once why the text ends early, if it does.
    void reportFailure();

  private:
    TextFeed& feed_;
    const OpenBeside& beside_;
    const ReaderOptions& options_;
    Diagnostics& diagnostics_;
    bool reported_ = false;
};

/// The library's own formats, which are asked behind those of a dialect.
std::span<const FormatReader> builtinReaders();
/// Null: no format fits. The library's own formats look at all of the head, however long it is: an OBJ file may begin
/// with a long comment.
const FormatReader* findReader(const FormatClue& clue, const Dialect* dialect);
/// Reads a file by a format; of one that is not the library's own text, what breaks the rules is reported and left out.
bool readBy(const FormatReader& reader, FeedSource& source, DocumentHandler& handler, Diagnostics& diagnostics);
/// The name by which a format may know a file: without a .gz at its end.
std::string_view plainName(std::string_view file);

}  // namespace rtsg::detail
