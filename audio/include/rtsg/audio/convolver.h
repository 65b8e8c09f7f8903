// Convolver: one signal through a long response, block by block, without delay beyond the block.
//
// Partitioned overlap-save in two sizes: the first fifteen blocks of a response in parts of a block, what
// is behind them in parts of sixteen, whose work is done once in sixteen blocks (Gardner 1995; Wefers 2015, 5.2
// and 6.1). A new response fades in smoothly, so that a moving source or wall makes no click; one that comes meanwhile
// waits. The first one is heard at once; where something sounds already, that fades in as if it began there.
// Threading: one thread per object.
#pragma once

#include <complex>
#include <cstddef>
#include <memory>
#include <span>
#include <vector>

namespace rtsg {

class Convolver {
  public:
    /// `turn`: which block of sixteen does the work of long parts, counted from the first block, whenever a response
    /// comes that has them. Convolvers that run side by side take turns, so that no block has the work of all.
    explicit Convolver(std::size_t blockSize = 512, std::size_t fadeSamples = 256, std::size_t turn = 0);
    ~Convolver();
    Convolver(Convolver&&) noexcept;
    Convolver& operator=(Convolver&&) noexcept;

    /// Another one of the same input: this one is told what comes, first of the two in each block, and what process()
    /// of the other is given counts for nothing.
    Convolver beside() const;
    /// From here on with an input of its own, which so far was the same. Does nothing for one that was not beside
    /// another.
    void part();

    /// A response made ready to be convolved with.
    class Response {
      public:
        Response() = default;

      private:
        friend class Convolver;
        std::vector<std::vector<std::complex<float>>> shorts_, longs_;
    };
    static Response prepare(std::size_t blockSize, std::span<const float> response);

    std::size_t blockSize() const;
    /// 1: the next block has the work of long parts; 0 as long as no response had any.
    std::size_t blocksUntilLongWork() const;
    /// Empty for silence. Takes effect with the next block.
    void setResponse(std::span<const float> response);
    /// Precondition: prepared for blocks of this size.
    void setResponse(const Response& response);
    void setResponse(Response&& response);
    /// The response that waits for the next block fades over in so many samples; later ones do so as usual.
    void fadeOnceIn(std::size_t samples);
    /// Forgets what it heard and which response it had, as if it were new, and keeps its memory: where responses are
    /// short, one that follows needs no other.
    void restart();
    /// Responses come evenly from here on, not smoothly: of one that changes on and on no step is heard.
    void fadeEvenly();
    /// Adds to `output`; both of blockSize() samples.
    void process(std::span<const float> input, std::span<float> output);

  private:
    struct Impl;
    explicit Convolver(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
