// rtsg assemble: joins numbered pictures, made by several jobs, into a film, and says which are missing.
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/field_text.h>
#include <rtsg/renderers/image.h>

#include "cli.h"
#include "files.h"
#include "output_arguments.h"

namespace rtsg::app {

namespace {

struct AssembleArguments {
    std::string pictures, frames, out;
    double fps = 25;
    bool json = false;
};

/// Numbers in a row, as "3,7-9".
class Numbers {
  public:
    void add(std::uint64_t number) {
        if (!runs_.empty() && runs_.back().second + 1 == number)
            runs_.back().second = number;
        else
            runs_.emplace_back(number, number);
        ++count_;
    }
    std::uint64_t count() const { return count_; }
    std::string text() const {
        std::string text;
        for (const auto& [first, last] : runs_)
            text += fmt::format("{}{}{}", text.empty() ? "" : ",", first, last > first ? fmt::format("-{}", last) : "");
        return text;
    }

  private:
    std::vector<std::pair<std::uint64_t, std::uint64_t>> runs_;
    std::uint64_t count_ = 0;
};

std::filesystem::path pictureOf(const AssembleArguments& options, std::uint64_t number) {
    const std::filesystem::path pattern = options.pictures;
    return pattern.parent_path() / *numberedName(pattern.filename().string(), static_cast<int>(number));
}

/// Those that are not there. A job writes a picture under its name once it is whole.
Numbers missingOf(const AssembleArguments& options, const PictureRange& range) {
    Numbers missing;
    std::error_code ignored;
    for (std::uint64_t number = range.first; number <= range.last; ++number)
        if (!std::filesystem::is_regular_file(pictureOf(options, number), ignored)) missing.add(number);
    return missing;
}

/// Reads all pictures, and writes the film unless there is none to write. Errors: one that cannot be read, or of
/// another size.
Result<> join(const AssembleArguments& options, const PictureRange& range) {
    std::optional<PictureFiles> film;
    if (!options.out.empty()) film.emplace(options.out, options.fps);
    const Progress progress = progressBar("joining " + options.pictures);
    int width = 0, height = 0;
    for (std::uint64_t number = range.first; number <= range.last; ++number) {
        if (interrupted()) return fail("interrupted: not written", {}, options.out);
        const std::string name = pictureOf(options, number).string();
        auto picture = readPicture(name);
        if (!picture) return std::unexpected(picture.error());
        if (number == range.first) width = picture->width, height = picture->height;
        if (picture->width != width || picture->height != height)
            return fail(fmt::format("{} x {} pixels, and the first picture has {} x {}", picture->width,
                                    picture->height, width, height),
                        {}, name);
        if (film)
            if (auto ok = film->add(std::move(*picture)); !ok) return ok;
        if (progress) progress(number - range.first + 1, range.count());
    }
    return film ? film->finish() : Result<>();
}

int assemble(const AssembleArguments& options) {
    const PictureRange range = PictureRange::parse(options.frames);
    if (!numberedName(std::filesystem::path(options.pictures).filename().string(), 0))
        throw UsageError("PICTURES", options.pictures + ": expected a name with a place for numbers, such as %04d");
    if (!options.out.empty() && !PictureFiles(options.out, 1).together())
        throw UsageError("-o", options.out + ": pictures are joined into a .mp4 or .gif");
    if (auto ok = checkFiles({}, {{"-o", options.out, OutputKind::picture}}, true); !ok)
        return printError(ok.error()), kBad;
    (void)interrupted();  // from here on an interruption ends the program in order and leaves no partial file
    const Numbers missing = missingOf(options, range);
    const Result<> joined = missing.count() == 0 ? join(options, range) : Result<>();
    const bool whole = missing.count() == 0 && joined;
    if (options.json)
        fmt::print("{{\"pictures\":{},\"missing\":{},\"missing_numbers\":{},\"written\":{}}}\n",
                   range.count() - missing.count(), missing.count(), jsonString(missing.text()),
                   whole && !options.out.empty() ? jsonString(options.out) : "null");
    else if (whole)
        fmt::print("{} pictures{}\n", range.count(), options.out.empty() ? ", all there" : " in " + options.out);
    if (missing.count() > 0)
        printError(fmt::format("missing: {} of {} pictures: {}", missing.count(), range.count(), missing.text()));
    if (!joined) printError(joined.error());
    return whole ? kDone : kBad;
}

}  // namespace

Verb addAssemble(Command& program) {
    auto options = std::make_shared<AssembleArguments>();
    Command* command =
        program.addVerb("assemble", "Join pictures that several jobs made into a film; say what is missing");
    command->addOption("PICTURES", options->pictures, "their names, such as out/%04d.png")->required();
    command->addOption("--frames", options->frames, "A-B: the numbers of all that there should be")->required();
    command->addOption("-o,--output", options->out, "film or GIF to write (.mp4, .gif); else they are only checked");
    command->addOption("--fps", options->fps, "pictures a second")->preset()->range(1e-3, 1e3);
    command->addFlag("--json", options->json, "the report as JSON");
    command->footer(
        "Example: rtsg assemble out/%04d.png --frames 0-1 --fps 25 -o film.mp4\n"
        "Exit status 1 where pictures are missing: their numbers are those that rtsg replay --frames takes.");
    return {command, [options] { return assemble(*options); }};
}

}  // namespace rtsg::app
