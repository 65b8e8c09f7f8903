// Worth: whether help pays, by what frames with it and without it took.
//
// Where other programs have the cores, to wait for a thread that is not running costs more than it saves; so frames go
// the better way, and one in kProbe the other. Nothing but time depends on it. Threading: one.
#pragma once

#include <cstdint>

namespace rtsg {

class Worth {
  public:
    /// For the frame that begins.
    bool shouldHelp() {
        const bool isKnown = cost_[0] > 0 && cost_[1] > 0;
        const bool better = !isKnown || cost_[1] < kGain * cost_[0];
        helps_ = (++frames_ % kProbe == kProbe / 4) != better;
        return helps_;
    }
    /// Of that frame.
    void note(double seconds, std::uint64_t work) {
        if (work == 0) return;
        double& cost = cost_[helps_ ? 1 : 0];
        const double now = seconds / static_cast<double>(work);
        cost = cost > 0 ? cost + (now - cost) / kInertia : now;
    }
    void forget() { *this = {}; }

  private:
    static constexpr unsigned kProbe = 32;
    static constexpr double kGain = .97, kInertia = 8;
    double cost_[2] = {};  // seconds for a unit of work, without help and with it; 0: not known
    unsigned frames_ = 0;
    bool helps_ = true;
};

}  // namespace rtsg
