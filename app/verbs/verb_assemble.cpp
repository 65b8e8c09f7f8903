// rtsg assemble: joins what several jobs made: tiles into pictures, pictures and stretches of sound into a film; it
// says what is missing.
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/field_text.h>
#include <rtsg/renderers/image.h>
#include <rtsg/renderers/picture_tiles.h>
#include <rtsg/session/joined_sound.h>
#include <rtsg/session/output_maker.h>

#include "assemble_live.h"
#include "cli.h"
#include "files.h"
#include "output_arguments.h"

namespace rtsg::app {

namespace {

struct AssembleArguments {
    std::string pictures, frames, tiles, sound, out, live, duration;
    double fps = 25;
    bool json = false, insecure = false;
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
    if (options.frames.empty()) return options.pictures;
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

/// What there is of tiles, and what there is not.
struct JoinedTiles {
    std::uint64_t missing = 0, wanted = 0;
    std::string text;  // the missing ones, by picture: "3: 0,1 1,1; 7: 0,0"
    Result<> result;   // the first failure
};

/// A tile of the picture that belongs to another division into tiles; empty: there is none.
std::string tileOfOthers(const std::filesystem::path& picture, const PictureTile& grid) {
    const std::string begins = picture.stem().string() + ".tile-",
                      own = fmt::format("-of-{}-{}{}", grid.columns, grid.rows, picture.extension().string());
    const std::filesystem::path folder = picture.has_parent_path() ? picture.parent_path() : ".";
    std::error_code ignored;
    for (const auto& entry : std::filesystem::directory_iterator(folder, ignored)) {
        const std::string name = entry.path().filename().string();
        if (name.starts_with(begins) && !name.ends_with(own)) return (picture.parent_path() / name).string();
    }
    return {};
}

/// Compares what files were made of with the first one's.
class Sameness {
  public:
    /// Error: a mixture.
    Result<> take(const std::string& file) { return take(file, false); }
    /// Of all tiles of a picture, if they are there; else of the picture, if that is.
    Result<> takeTiles(const std::filesystem::path& picture, const PictureTile& grid) {
        std::error_code ignored;
        std::vector<std::string> tiles;
        for (int i = 0; i < grid.columns * grid.rows; ++i) {
            const PictureTile tile{i % grid.columns, i / grid.columns, grid.columns, grid.rows};
            const std::filesystem::path file = tile.of(picture);
            if (std::filesystem::is_regular_file(file, ignored)) tiles.push_back(file.string());
        }
        if (std::ssize(tiles) < std::ptrdiff_t{grid.columns} * grid.rows)
            return std::filesystem::is_regular_file(picture, ignored) ? take(picture.string()) : Result<>();
        for (const std::string& tile : tiles)
            if (auto ok = take(tile, tile != tiles.front()); !ok) return ok;
        return {};
    }
    const Provenance& first() const { return first_; }

  private:
    /// `ofOneState`: as the file before.
    Result<> take(const std::string& file, bool ofOneState) {
        const auto notes = readPictureNotes(file);
        if (!notes) return std::unexpected(notes.error());
        Provenance own = Provenance::of(*notes);
        if (firstFile_.empty()) first_ = own, firstFile_ = file;
        Result<> same = belongsTogether(own, file, first_, firstFile_);
        if (same && ofOneState) same = isOneState(own, file, before_, fileBefore_);
        before_ = std::move(own), fileBefore_ = file;
        return same;
    }

    Provenance first_, before_;
    std::string firstFile_, fileBefore_;
};

/// Joins the tiles of each picture. A picture that is there without all of its tiles has been joined before.
JoinedTiles joinAllTiles(const AssembleArguments& options, const PictureRange& range) {
    JoinedTiles joined;
    const PictureTile grid = parseTileGrid(options.tiles);
    const Progress progress = progressBar("joining tiles of " + options.pictures);
    std::error_code ignored;
    std::string others;
    Sameness all;
    for (std::uint64_t number = range.first; number <= range.last; ++number) {
        if (interrupted()) {
            joined.result = fail("interrupted: not all tiles were joined", {}, options.pictures);
            break;
        }
        const std::filesystem::path picture = pictureOf(options, number);
        const Result<> same = all.takeTiles(picture, grid);
        // A picture alone is the same file as one that was made as a whole.
        const auto missing = same ? joinTiles(picture, grid.columns, grid.rows, options.frames.empty() ? "rtsg-" : "")
                                  : std::unexpected(same.error());
        joined.wanted += static_cast<std::uint64_t>(grid.columns) * static_cast<std::uint64_t>(grid.rows);
        if (!missing) {
            if (joined.result) joined.result = std::unexpected(missing.error());
        } else if (!missing->empty() && !std::filesystem::is_regular_file(picture, ignored)) {
            joined.missing += missing->size();
            joined.text += joined.text.empty() ? "" : "; ";
            if (!options.frames.empty()) joined.text += fmt::format("{}: ", number);
            for (const PictureTile& tile : *missing)
                joined.text += fmt::format("{}{},{}", tile == missing->front() ? "" : " ", tile.x, tile.y);
            if (others.empty()) others = tileOfOthers(picture, grid);
        }
        if (progress) progress(number - range.first + 1, range.count());
    }
    if (!others.empty()) joined.text += fmt::format(" ({} is of another division into tiles)", others);
    return joined;
}

/// All of the sound, scaled as that of one run. Error: some of it is missing.
Result<JoinedSound> wholeSound(const AssembleArguments& options, const std::string& pattern,
                               const PictureRange& range) {
    auto joined = joinSound(pattern, range, options.fps);
    if (!joined) return std::unexpected(joined.error());
    Numbers missing;
    for (const auto& [first, last] : joined->missing)
        for (std::uint64_t number = first; number <= last; ++number) missing.add(number);
    if (missing.count() > 0)
        return fail(
            fmt::format("missing: the sound of {} of {} pictures: {}", missing.count(), range.count(), missing.text()),
            {}, pattern);
    ListenReport report;
    report.sound = std::move(joined->sound);
    report.gain = normalise(report.sound);
    reportGain(report, programContext());
    joined->sound = std::move(report.sound);
    return joined;
}

/// The sound is of the pictures' session, as far as both say.
Result<> belongsToSound(const Provenance& pictures, const std::string& file, const JoinedSound& sound) {
    if (pictures.session.empty() || sound.provenance.session.empty() || pictures.session == sound.provenance.session)
        return {};
    return fail(
        fmt::format("a mixture: session {}, not {} as in {}", pictures.session, sound.provenance.session, sound.first),
        {}, file);
}

/// Reads all pictures, and writes the film unless there is none to write. Errors: one that cannot be read, or of
/// another size; a mixture.
Result<> join(const AssembleArguments& options, const PictureRange& range) {
    std::optional<PictureFiles> film;
    JoinedSound joined;
    const SoundBuffer& sound = joined.sound;
    if (!options.sound.empty()) {
        auto whole = wholeSound(options, options.sound, range);
        if (!whole) return std::unexpected(whole.error());
        joined = std::move(*whole);
    }
    const auto with = options.sound.empty() ? MovieWriter::Sound::none : MovieWriter::Sound::awaited;
    if (!options.out.empty()) film.emplace(options.out, options.fps, ToneMap(), with);
    const Progress progress = progressBar("joining " + options.pictures);
    int width = 0, height = 0;
    Sameness same;
    for (std::uint64_t number = range.first; number <= range.last; ++number) {
        if (interrupted()) return fail("interrupted: not written", {}, options.out);
        const std::string name = pictureOf(options, number).string();
        auto picture = readPicture(name);
        if (!picture) return std::unexpected(picture.error());
        if (auto ok = same.take(name); !ok) return ok;
        if (number == range.first)
            if (auto ok = belongsToSound(same.first(), name, joined); !ok) return ok;
        if (number == range.first) width = picture->width, height = picture->height;
        if (picture->width != width || picture->height != height)
            return fail(fmt::format("{} x {} pixels, and the first picture has {} x {}", picture->width,
                                    picture->height, width, height),
                        {}, name);
        if (film)
            if (auto ok = film->add(std::move(*picture)); !ok) return ok;
        if (progress) progress(number - range.first + 1, range.count());
    }
    if (film && !options.sound.empty())
        if (auto ok = film->addSound(sound.samples, sound.sampleRate, sound.channels); !ok) return ok;
    return film ? film->finish() : Result<>();
}

bool isSound(const std::string& file) {
    return lowerExtension(file) == ".wav";
}

int assembleSound(const AssembleArguments& options, const PictureRange& range) {
    const auto sound = wholeSound(options, options.pictures, range);
    const Result<> written = !sound                ? std::unexpected(sound.error())
                             : options.out.empty() ? Result<>()
                                                   : writeWav(options.out, sound->sound);
    if (options.json)
        fmt::print("{{\"seconds\":{:.6f},\"written\":{}}}\n", sound ? sound->sound.seconds() : 0,
                   written && !options.out.empty() ? jsonString(options.out) : "null");
    else if (written)
        fmt::print("{:g} s of sound{}\n", sound->sound.seconds(),
                   options.out.empty() ? ", all there" : " in " + options.out);
    if (!written) printError(written.error());
    return written ? kDone : kBad;
}

/// Throws UsageError for options that do not fit together.
PictureRange checkOptions(const AssembleArguments& options) {
    const bool numbered = numberedName(std::filesystem::path(options.pictures).filename().string(), 0).has_value();
    if (!options.tiles.empty()) {
        (void)parseTileGrid(options.tiles);
        if (auto ok = checkTileName(options.pictures); !ok) throw UsageError("PICTURES", ok.error().format());
    }
    if (!numbered && (options.tiles.empty() || !options.frames.empty()))
        throw UsageError("PICTURES", options.pictures + ": expected a name with a place for numbers, such as %04d");
    if (numbered && options.frames.empty())
        throw UsageError("--frames", "says the numbers of all that there should be, such as 0-99");
    if (!options.sound.empty() && (isSound(options.pictures) || !isSound(options.sound) ||
                                   !numberedName(std::filesystem::path(options.sound).filename().string(), 0)))
        throw UsageError("--sound", options.sound + ": expected stretches of sound beside pictures, such as %04d.wav");
    if (!options.sound.empty() && !options.out.empty() && lowerExtension(options.out) != ".mp4")
        throw UsageError("--sound", "goes into a .mp4");
    if (isSound(options.pictures)) {
        if (!options.out.empty() && !isSound(options.out))
            throw UsageError("-o", options.out + ": stretches of sound are joined into a .wav");
    } else if (!options.out.empty() && (!numbered || !PictureFiles(options.out, 1).together()))
        throw UsageError("-o", options.out + ": numbered pictures are joined into a .mp4 or .gif");
    return numbered ? parsePictureRange(options.frames) : PictureRange();
}

/// Says what was joined and what is missing, and returns the status.
int reportJoined(const AssembleArguments& options, const PictureRange& range, const JoinedTiles& tiles,
                 const Numbers& missing, const Result<>& joined) {
    const bool whole = missing.count() == 0 && tiles.result && joined;
    if (options.json)
        fmt::print("{{\"pictures\":{},\"missing\":{},\"missing_numbers\":{},\"missing_tiles\":{},\"written\":{}}}\n",
                   range.count() - missing.count(), missing.count(), jsonString(missing.text()), tiles.missing,
                   whole && !options.out.empty() ? jsonString(options.out) : "null");
    else if (whole && options.frames.empty())
        fmt::print("{}: {} tiles\n", options.pictures, tiles.wanted);
    else if (whole)
        fmt::print("{} pictures{}\n", range.count(), options.out.empty() ? ", all there" : " in " + options.out);
    if (tiles.missing > 0)
        printError(fmt::format("missing: {} of {} tiles: {}", tiles.missing, tiles.wanted, tiles.text));
    else if (missing.count() > 0 && tiles.result)
        printError(fmt::format("missing: {} of {} pictures: {}", missing.count(), range.count(), missing.text()));
    if (!tiles.result) printError(tiles.result.error());
    if (!joined) printError(joined.error());
    return whole ? kDone : kBad;
}

int assemble(const AssembleArguments& options) {
    if (!options.live.empty()) {
        if (!options.pictures.empty() || !options.frames.empty() || !options.sound.empty())
            throw UsageError("--live", "goes together with --tiles, --for, --insecure and -o alone");
        return assembleLive(
            {options.live, options.tiles, options.out, options.duration, options.insecure, options.json});
    }
    if (options.pictures.empty()) throw UsageError("PICTURES", "says what is to be joined, such as out/%04d.png");
    if (!options.duration.empty() || options.insecure)
        throw UsageError(options.insecure ? "--insecure" : "--for", "goes with --live");
    const PictureRange range = checkOptions(options);
    const OutputKind kind = isSound(options.pictures) ? OutputKind::sound : OutputKind::picture;
    if (auto ok = checkFiles({}, {{"-o", options.out, kind}}, true); !ok) return printError(ok.error()), kBad;
    (void)interrupted();  // from here on an interruption ends the program in order and leaves no partial file
    if (isSound(options.pictures)) return assembleSound(options, range);
    const JoinedTiles tiles = options.tiles.empty() ? JoinedTiles() : joinAllTiles(options, range);
    const Numbers missing = missingOf(options, range);
    // Tiles that were joined just now have been read, and one picture is no film.
    const bool more = options.tiles.empty() || !options.out.empty() || !options.sound.empty();
    const bool reads = missing.count() == 0 && tiles.result && more;
    return reportJoined(options, range, tiles, missing, reads ? join(options, range) : Result<>());
}

}  // namespace

Verb addAssemble(Command& program) {
    auto options = std::make_shared<AssembleArguments>();
    Command* command =
        program.addVerb("assemble", "Join what several jobs made: tiles, pictures, sound; say what is missing");
    command->addOption(
        "PICTURES", options->pictures,
        "their names, such as out/%04d.png; of tiles one alone, too; or those of stretches of sound, such "
        "as out/%04d.wav");
    command->addOption("--frames", options->frames, "A-B: the numbers of all that there should be");
    command->addOption("--tiles", options->tiles,
                       "COLUMNS,ROWS: each picture is first joined of its tiles, where these are all there");
    command->addOption("--sound", options->sound, "stretches of sound for the film, such as out/%04d.wav");
    command->addOption("-o,--output", options->out,
                       "film, GIF or sound to write (.mp4, .gif, .wav); else they are only checked");
    command->addOption("--fps", options->fps, "pictures a second")->preset()->range(1e-3, 1e3);
    command->addOption("--live", options->live,
                       "tcp://HOST:PORT: join pictures of a served scene of tiles that rtsg mirror --tiles draws");
    command->addOption("--for", options->duration, "how long --live goes on; else until the mirrors go, or Ctrl-C");
    command->addFlag("--insecure", options->insecure, "let mirrors on other machines in, without keys");
    command->addFlag("--json", options->json, "the report as JSON");
    command->footer(
        "Example: rtsg assemble out/%04d.png --frames 0-1 --fps 25 -o film.mp4\n"
        "Example: rtsg assemble out/%04d.png --frames 0-1 --tiles 2,2\n"
        "Example: rtsg assemble out/%04d.wav --frames 0-1 --fps 25 -o sound.wav\n"
        "Exit status 1 where pictures are missing: their numbers are those that rtsg replay --frames takes.");
    return {command, [options] { return assemble(*options); }};
}

}  // namespace rtsg::app
