// ImagePlayer: plays the image sources of a moving source, each from its present position in every block, and
// diffracted sound.
//
// A new set of images fades in block by block with the response of a Convolver of the same block and fade length, so
// that the sound which moves from one to the other stays complete. Memory of sets and blocks is reused: after the
// largest one no block allocates. Threading: the engine's thread.
#pragma once

#include <array>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "edges/arrival_pan.h"
#include "images/followed_edges.h"
#include "images/followed_images.h"
#include "ring.h"
#include "signal/convolver.h"
#include "signal/delay_line.h"
#include "signal/head_filter.h"
#include "signal/pole_bank.h"

namespace rtsg {

/// The state of the straight way when a set of images was traced: the share of direct sound's amplitude that moving
/// walls left, and the time, seconds.
struct StraightPath {
    double open = 1;
    double at = -std::numeric_limits<double>::infinity();
};

class ImagePlayer {
  public:
    using Images = std::shared_ptr<const std::vector<FollowedImage>>;

    ImagePlayer(std::size_t block, std::size_t fade) : block_(block), fade_(std::max<std::size_t>(1, fade)) {}

    /// Null or empty: none. `fadeOnce`: samples in which these fade over, 0: as usual.
    void set(Images images, std::size_t fadeOnce = 0, const StraightPath& straight = {}) {
        waiting_ = std::move(images);
        waitingStraight_ = straight;
        waits_ = true;
        onceIn_ = fadeOnce;
    }
    bool fades() const { return fading_ || waits_; }
    /// The state of the straight way for the set that is heard.
    const StraightPath& straight() const { return current_.straight; }
    /// StraightPath::open at the end of the next block, as sets fade over.
    double openNext() const;
    /// These change StraightPath::open of all sets.
    void scaleOpen(double factor);
    void setOpen(double open);

    struct EdgeEnds {
        glm::dvec3 source, listener;
    };
    /// The inputs and outputs of a block.
    struct Block {
        /// The samples that are reflected in this block: all channels mixed, or two that stay apart.
        std::span<const std::vector<float>> late;
        /// Finds a delay and its slope, samples, at the end of step k of the block (-1: at its start); `delay` comes
        /// with a guess. A caller whose blocks must not allocate passes a reference.
        std::function<void(const FollowedImage&, int step, double& delay, double& slope)> find;
        /// The place of the image, relative to the listener, when the sound left that arrives at the end of the block.
        std::function<glm::dvec3(const FollowedImage&, double delay)> from;
        const ImpulseResponseOptions& response;  // the listener's axes and channels
        bool jumps = false;                 // it was put somewhere else: from one delay to another within the block
        std::span<std::vector<float>> out;  // by channel; is added to
        /// If the image has a head of its own, by ear, in place of `out`; the sound is later by Hrtf::early().
        std::span<std::vector<float>> ears = {};
        // For waves by way of edges: the source when that went out which arrives at the end of the block with a delay,
        // and the listener then.
        std::function<EdgeEnds(double delay)> ends = {};
        double reflects = 1;  // factor by which `late` is louder than the played sound, at the end of the block
        bool heard = true;    // direct sound is, at the end of the block
    };
    /// Samples between the places that a block asks for.
    static constexpr std::size_t kStep = 32;
    void render(const Block& block);

  private:
    struct Voice {
        double delay = 0, slope = 0;
        bool started = false;
        std::vector<ArrivalPan> pans, before;  // by channel, times pressure: of this block and the last
        std::vector<Convolver> filters;
        std::size_t filtersInUse = 0;
        HeadFilter head;
        // For an edge: the filter of each signal, and its weights at the end of the last block and of this one.
        std::vector<PoleBank> banks;
        PoleBank::Weights weightsBefore{}, weights{};
        double fraction = 0;  // of a boundary's image, at the end of the last block

        void restart();
    };
    struct Set {
        Images images;
        std::vector<Voice> voices;  // at least as many
        StraightPath straight;

        std::size_t count() const { return images ? images->size() : 0; }
        void start(Images what, const StraightPath& known);
    };
    void render(Set& set, const Block& block, bool arrives);
    void render(const FollowedImage& image, Voice& voice, const Block& block);
    void panVoice(const FollowedImage& image, Voice& voice, bool fresh, const Block& block) const;
    bool isSilent(const FollowedImage& image, Voice& voice, const Block& block) const;
    double amplitudeOf(const FollowedImage& image, const Voice& voice, double distance, const Block& block) const;
    void filter(const FollowedImage& image, Voice& voice, std::size_t signal, const Block& block);
    double reflectedBefore(double delay) const;
    void readLine(const DelayLine& line, const Voice& voice, double before, std::size_t channel, bool jumps,
                  double ahead);
    void findDelays(const FollowedImage& image, Voice& voice, const Block& block);

    static constexpr std::size_t kLongAgo = std::numeric_limits<std::size_t>::max() / 2;

    std::size_t block_, fade_, onceIn_ = 0;
    std::size_t silent_ = kLongAgo;    // samples since something was reflected
    std::size_t fadeSamples_ = fade_;  // of the set that fades in
    std::array<DelayLine, 2> lines_;
    Ring<double> reflected_;  // Block::reflects, of as many blocks as the lines hold
    Set current_, next_;
    Images waiting_;
    StraightPath waitingStraight_;
    bool fading_ = false, waits_ = false, started_ = false;
    std::size_t faded_ = 0;
    // Buffers, by sample, for the image that is rendered at present.
    std::vector<float> weights_, read_, heard_;
    std::vector<double> delays_, later_;
};

}  // namespace rtsg
