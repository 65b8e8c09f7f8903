// A hand on a path: it is either wherever the path is, or a mass that a spring and a damper hold to it.
#include <rtsg/haptics/haptic_device.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <optional>
#include <string_view>

#include <fmt/format.h>
#include <glm/geometric.hpp>

namespace rtsg {

namespace {

constexpr double kLongestStep = 1e-4;  // seconds, in which the force is taken to stay

class SimulatedDevice final : public HapticDevice {
  public:
    explicit SimulatedDevice(SimulatedHand hand) : hand_(std::move(hand)), at_(target(0)) {}

    Result<Vec3d> position(double seconds) override {
        if (hand_.mass > 0 && time_ && seconds > *time_) {
            const int steps = static_cast<int>(std::ceil(std::min((seconds - *time_) / kLongestStep, 1e5)));
            for (int i = 1; i <= steps; ++i) {
                const double t = *time_ + (seconds - *time_) * i / steps;
                swing(t, (seconds - *time_) / steps);
            }
        } else if (hand_.mass <= 0) {
            at_ = target(seconds);
        }
        time_ = seconds;
        return at_;
    }
    void push(const Vec3d& force) override { force_ = force; }
    bool hasEnded() const override { return hand_.path.empty() || (time_ && *time_ >= hand_.path.back().seconds); }

  private:
    Vec3d target(double seconds) const {
        const auto& path = hand_.path;
        if (path.empty()) return Vec3d(0);
        const auto next = std::ranges::upper_bound(path, seconds, {}, &SimulatedHand::Stop::seconds);
        if (next == path.begin()) return path.front().position;
        const auto last = next - 1;
        if (next == path.end() || next->seconds <= last->seconds) return last->position;
        return last->position +
               (seconds - last->seconds) / (next->seconds - last->seconds) * (next->position - last->position);
    }
    /// Semi-implicit Euler: the spring's energy stays bounded.
    void swing(double seconds, double step) {
        const Vec3d arm = hand_.stiffness * (target(seconds) - at_) - hand_.damping * velocity_;
        velocity_ += step / hand_.mass * (arm + force_);
        at_ += step * velocity_;
    }

    const SimulatedHand hand_;
    Vec3d at_, velocity_{0}, force_{0};
    std::optional<double> time_;
};

/// The numbers of a line, by commas; nothing if there is anything else.
std::optional<std::vector<double>> numbersOf(std::string_view line) {
    std::vector<double> numbers;
    while (!line.empty()) {
        const auto end = std::min(line.find(','), line.size());
        std::string_view word = line.substr(0, end);
        while (!word.empty() && word.front() == ' ') word.remove_prefix(1);
        while (!word.empty() && (word.back() == ' ' || word.back() == '\r')) word.remove_suffix(1);
        double number = 0;
        const auto [rest, error] = std::from_chars(word.data(), word.data() + word.size(), number);
        if (error != std::errc() || rest != word.data() + word.size() || !std::isfinite(number)) return std::nullopt;
        numbers.push_back(number);
        line.remove_prefix(std::min(end + 1, line.size()));
    }
    return numbers;
}

}  // namespace

std::unique_ptr<HapticDevice> simulatedDevice(SimulatedHand hand) {
    return std::make_unique<SimulatedDevice>(std::move(hand));
}

Result<std::vector<SimulatedHand::Stop>> readHandPath(const std::string& file) {
    std::ifstream in(file);
    if (!in) return fail(fmt::format("{}: cannot be read", file));
    std::vector<SimulatedHand::Stop> path;
    std::string line;
    for (int number = 1; std::getline(in, line); ++number) {
        line.erase(std::min(line.find('#'), line.size()));
        if (line.find_first_not_of(" \t\r") == line.npos) continue;
        const auto numbers = numbersOf(line);
        const bool isHeading = !numbers && path.empty() && line.find_first_of("0123456789") == line.npos;
        if (isHeading) continue;
        if (!numbers || numbers->size() != 4)
            return fail(fmt::format("{}:{}: a line of a hand's path is seconds,x,y,z", file, number));
        if (!path.empty() && (*numbers)[0] < path.back().seconds)
            return fail(fmt::format("{}:{}: times of a hand's path do not go back", file, number));
        path.push_back({(*numbers)[0], {(*numbers)[1], (*numbers)[2], (*numbers)[3]}});
    }
    if (path.empty()) return fail(fmt::format("{}: there is no path in it", file));
    return path;
}

}  // namespace rtsg
