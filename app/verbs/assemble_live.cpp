// Writes pictures as TileAssembler joins them, and tells how many there were.
#include "assemble_live.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <rtsg/session/tile_assembler.h>

#include "cli.h"
#include "files.h"
#include "output_arguments.h"
#include "say.h"

namespace rtsg::app {

namespace {

using Clock = std::chrono::steady_clock;

constexpr double kPatience = 10, kGone = 1;              // seconds without a mirror: at first, and once there were some
constexpr std::chrono::milliseconds kLongestWait{2000};  // a signal may come just before a wait, and is seen after it

double since(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
}

/// Writes a PPM, which programs that show films read one after the other.
Result<> stream(const TileAssembler::Joined& joined) {
    std::string ppm = fmt::format("P6\n{} {}\n255\n", joined.width, joined.height);
    for (std::size_t i = 0; i < joined.pixels.size(); i += 4) ppm.append(joined.pixels, i, 3);
    if (std::fwrite(ppm.data(), 1, ppm.size(), stdout) != ppm.size() || std::fflush(stdout) != 0)
        return fail("standard output takes no more pictures");
    return {};
}

class LiveAssembling {
  public:
    LiveAssembling(const LiveAssembly& options, TileAssembler& assembler)
        : options_(options),
          assembler_(assembler),
          duration_(options.duration.empty() ? 1e9 : parseSeconds(options.duration)) {}

    int run() {
        report(options_.json ? fmt::format("{{\"endpoint\":{}}}", jsonString(assembler_.address()))
                             : "joins tiles at " + assembler_.address());
        while (!interrupted() && problem_ && !isOver()) {
            const auto joined = assembler_.poll(untilDue());
            for (const std::string& why : assembler_.takeProblems()) printError(why);
            if (std::exchange(hears_, assembler_.counts().mirrors > 0) || hears_) heard_ = Clock::now();
            if (joined) problem_ = add(*joined);
        }
        if (problem_ && files_) problem_ = files_->finish(skippedBefore(assembler_.counts().newest + 1));
        if (!problem_) printError(problem_.error());
        if (states_.empty() && problem_)
            printError("no picture was joined: no mirror drew tiles (rtsg mirror --tiles)");
        reportCounts();
        return problem_ && !states_.empty() ? kDone : kBad;
    }

  private:
    /// Seconds until the end if no mirror says anything.
    double left() const {
        const double gone = (assembler_.counts().maxMirrors > 0 ? kGone : kPatience) - since(heard_);
        const double end = states_.empty() ? INFINITY : duration_ - since(first_);
        return std::min(hears_ ? INFINITY : gone, end);
    }
    bool isOver() const { return left() <= 0; }
    std::chrono::milliseconds untilDue() const {
        const std::chrono::duration<double> maximum = kLongestWait;
        return std::chrono::ceil<std::chrono::milliseconds>(std::min(maximum, std::chrono::duration<double>(left())));
    }
    /// Pictures since the last one that was joined, which look as it does.
    std::uint64_t skippedBefore(std::uint64_t number) const {
        return number_ > 0 && number > number_ ? number - number_ - 1 : 0;
    }
    /// Pictures may be on standard output.
    void report(const std::string& line) const {
        if (options_.out == "-") return reportError("{}\n", line);
        fmt::print("{}\n", line);
        std::fflush(stdout);
    }
    Result<> add(const TileAssembler::Joined& joined) {
        if (states_.empty()) first_ = Clock::now();
        last_ = Clock::now();
        states_.push_back(joined.sequence), times_.push_back(joined.time);
        delay_ += joined.seconds;
        const std::uint64_t skipped = skippedBefore(joined.number);
        number_ = joined.number;
        if (options_.out.empty()) return {};
        if (options_.out == "-") return stream(joined);
        if (!files_) files_.emplace(options_.out, assembler_.picturesPerSecond());
        const std::vector<std::uint8_t> bytes(joined.pixels.begin(), joined.pixels.end());
        return files_->add(pictureOfBytes(bytes, joined.width, joined.height), skipped);
    }
    void reportCounts() const {
        const TileAssembler::Counts& counts = assembler_.counts();
        const double seconds = std::chrono::duration<double>(last_ - first_).count();
        const auto pictures = static_cast<double>(states_.size());
        const double rate = pictures > 1 && seconds > 0 ? (pictures - 1) / seconds : 0;
        if (!options_.json)
            return report(
                fmt::format("{} pictures by {} mirrors, {:.2f} a second, {:.0f} ms each; {} tiles asked again, {} "
                            "pictures given up",
                            states_.size(), counts.maxMirrors, rate, 1e3 * delay_ / std::max(pictures, 1.0),
                            counts.again, counts.given));
        report(fmt::format(
            "{{\"pictures\":{},\"mirrors\":{},\"seconds\":{:.3f},\"fps\":{:.3f},\"delay_s\":{:.4f},"
            "\"tiles\":{},\"bytes\":{},\"again\":{},\"given_up\":{},\"states\":[{}],\"times\":[{}]}}",
            states_.size(), counts.maxMirrors, seconds, rate, delay_ / std::max(pictures, 1.0), counts.tiles,
            counts.bytes, counts.again, counts.given, fmt::join(states_, ","), fmt::join(times_, ",")));
    }

    const LiveAssembly& options_;
    TileAssembler& assembler_;
    const double duration_;
    std::optional<PictureFiles> files_;
    Result<> problem_;
    bool hears_ = false;  // there are mirrors
    Clock::time_point heard_ = Clock::now(), first_, last_;
    std::vector<std::uint64_t> states_;
    std::vector<double> times_;
    double delay_ = 0;
    std::uint64_t number_ = 0;
};

}  // namespace

int assembleLive(const LiveAssembly& options) {
    const PictureTile grid = options.tiles.empty() ? PictureTile{0, 0, 2, 2} : parseTileGrid(options.tiles);
    if (options.out != "-")
        if (auto ok = checkFiles({}, {{"-o", options.out, OutputKind::picture}}, true); !ok)
            return printError(ok.error()), kBad;
    auto door = TileDoor::open(options.address, options.insecure);
    if (!door) return printError(door.error()), kBad;
    (void)interrupted();  // from here on an interruption ends the program in order
    TileAssembler assembler(std::move(*door), grid.columns, grid.rows);
    return LiveAssembling(options, assembler).run();
}

}  // namespace rtsg::app
