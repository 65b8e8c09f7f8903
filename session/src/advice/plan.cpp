// Writes and reads plans: the settings that trials found best.
#include <charconv>
#include <fstream>
#include <sstream>

#include <fmt/format.h>

#include <rtsg/session/advice.h>

#include "trials.h"

namespace rtsg {

namespace {

template <class T>
bool parse(std::string_view text, T minimum, T maximum, std::optional<T>& into) {
    T value{};
    const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (problem != std::errc() || end != text.data() + text.size() || !(value >= minimum && value <= maximum))
        return false;
    into = value;
    return true;
}

/// The words of a line and the columns at which they begin.
class Words {
  public:
    explicit Words(std::string_view line) : line_(line.substr(0, line.find('#'))) {}
    /// Empty at the end; column() is then that behind the last word.
    std::string_view next() {
        at_ = std::min(line_.find_first_not_of(" \t\r", at_), line_.size());
        begin_ = at_;
        at_ = std::min(line_.find_first_of(" \t\r", at_), line_.size());
        return line_.substr(begin_, at_ - begin_);
    }
    std::uint32_t column() const { return static_cast<std::uint32_t>(begin_ + 1); }

  private:
    std::string_view line_;
    std::size_t at_ = 0, begin_ = 0;
};

/// False if the option is not one of a plan, or has no such value.
bool setOption(Plan& plan, bool renders, std::string_view option, std::string_view value) {
    if (renders && option == "--integrator" && (value == "whitted" || value == "path")) {
        plan.integrator = value;
        return true;
    }
    if (renders && option == "--color-space" && value == "linear") return plan.linear = true;
    if (renders && option == "--spp") return parse(value, 1, 1 << 20, plan.samples);
    if (!renders && option == "--quality") return parse(value, .25, 16.0, plan.quality);
    return !renders && option == "--diffraction" && parse(value, 0, 2, plan.diffraction);
}

}  // namespace

std::string Plan::toText(const std::string& scene) const {
    std::string text =
        fmt::format("# Settings of rtsg advise for {}\n", scene.find('\n') == std::string::npos ? scene : "a scene");
    if (integrator && samples)
        text += fmt::format("render --integrator {} --spp {}{}  # error {} of the mean\n", *integrator, *samples,
                            linear ? " --color-space linear" : "", advice::figure(pictureError));
    if (quality)
        text +=
            fmt::format("listen --quality {}{}  # error {} JND\n", *quality,
                        diffraction ? fmt::format(" --diffraction {}", *diffraction) : "", advice::figure(soundError));
    return text;
}

Result<Plan> Plan::read(const std::string& file) {
    std::ifstream in(file, std::ios::binary);
    if (!in) return fail("the plan cannot be read", {}, file);
    Plan plan;
    std::string line;
    for (std::uint32_t number = 1; std::getline(in, line); ++number) {
        Words words(line);
        const std::string_view verb = words.next();
        if (verb.empty()) continue;
        if (verb != "render" && verb != "listen")
            return fail(fmt::format("a line of a plan begins with render or listen, not \"{}\"", verb.substr(0, 40)),
                        {number, words.column()}, file);
        for (std::string_view option = words.next(); !option.empty(); option = words.next()) {
            const std::uint32_t column = words.column();
            const std::string_view value = words.next();
            if (!setOption(plan, verb == "render", option, value))
                return fail(fmt::format("\"{} {}\" is no option of {} that a plan may have", option.substr(0, 40),
                                        value.substr(0, 40), verb),
                            {number, column}, file);
        }
    }
    if (in.bad()) return fail("the plan cannot be read to its end", {}, file);
    return plan;
}

}  // namespace rtsg
