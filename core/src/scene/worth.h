// Worth: whether help pays, by what frames with it and without it took.
//
// Where other programs have the cores, to wait for a thread that is not running costs more than it saves. So frames
// begin without help, get it once it has shown that it pays, and two in kEvery try the other way. Nothing but time
// depends on it. Threading: one.
#pragma once

#include <cstdint>

namespace rtsg {

class Worth {
  public:
    /// For the frame that begins.
    bool shouldHelp() {
        const bool pays = cost_[0] > 0 && cost_[1] > 0 && cost_[1] < kGain * cost_[0];
        const unsigned turn = frames_++ % kEvery;
        helps_ = pays != (turn == kProbe || turn == kProbe + 1);
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
    static constexpr unsigned kEvery = 128, kProbe = 6;
    static constexpr double kGain = .9, kInertia = 8;
    double cost_[2] = {};  // seconds for a unit of work, without help and with it; 0: not known
    unsigned frames_ = 0;
    bool helps_ = false;
};

}  // namespace rtsg
