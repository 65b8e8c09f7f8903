// Convolver: convolves one signal with a long response, block by block, with no delay beyond the block.
//
// Partitioned overlap-save with two sizes of partitions: the first fifteen blocks of a response have partitions of one
// block, the rest has partitions of sixteen blocks, which are computed once in sixteen blocks (Gardner 1995; Wefers
// 2015, 5.2 and 6.1). A new response fades in smoothly, so that a moving source or wall makes no click. A response that
// arrives during a fade waits. The first response is used at once; if sound is playing already, it fades in as if it
// had just begun.
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
    /// `turn`: which of sixteen blocks computes the long partitions, counted from the first block, whenever a response
    /// with such partitions arrives. Give convolvers that run side by side different turns, so that no block has all
    /// the work.
    explicit Convolver(std::size_t blockSize = 512, std::size_t fadeSamples = 256, std::size_t round = 0);
    ~Convolver();
    Convolver(Convolver&&) noexcept;
    Convolver& operator=(Convolver&&) noexcept;

    /// Another convolver with the same input. In each block, call process() of this one first; the input that is passed
    /// to the other one is ignored.
    Convolver beside() const;
    /// Gives this convolver its own input from here on; until now it shared one. Does nothing for one that did not.
    void part();

    /// A response that has been transformed for the convolution.
    class Response {
      public:
        Response() = default;

      private:
        friend class Convolver;
        std::vector<std::vector<std::complex<float>>> shorts_, longs_;
    };
    static Response prepare(std::size_t blockSize, std::span<const float> response);

    std::size_t blockSize() const;
    /// 1: the next block computes the long partitions; 0 if no response has had any.
    std::size_t blocksUntilLongWork() const;
    /// Takes effect with the next block. An empty response is silence.
    void setResponse(std::span<const float> response);
    /// Precondition: the response was made for this block size.
    void setResponse(const Response& response);
    void setResponse(Response&& response);
    /// The response that waits for the next block fades in over this many samples; later ones fade as usual.
    void fadeOnceIn(std::size_t samples);
    /// Resets the convolver as if it were new but keeps its memory. For short responses the next one then needs no
    /// allocation.
    void restart();
    /// From here on responses fade linearly, not smoothly: if the response changes continually, no step is heard.
    void fadeEvenly();
    /// Adds to `output`; both have blockSize() samples.
    void process(std::span<const float> input, std::span<float> output);

  private:
    struct Impl;
    explicit Convolver(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
