// Convolver: one signal through a long response, block by block, without delay beyond the block.
//
// Uniformly partitioned overlap-save (Kulp 1988; Wefers 2015, 5.2) on kissfft. A new response fades in smoothly, so
// that a moving source or wall makes no click; one that comes meanwhile waits. Threading: one thread per object.
#pragma once

#include <complex>
#include <cstddef>
#include <memory>
#include <span>
#include <vector>

namespace rtsg {

class Convolver {
  public:
    explicit Convolver(std::size_t blockSize = 512, std::size_t fadeSamples = 256);
    ~Convolver();
    Convolver(Convolver&&) noexcept;
    Convolver& operator=(Convolver&&) noexcept;

    /// A response made ready to be convolved with.
    class Response {
      public:
        Response() = default;
        std::size_t partitions() const { return parts_.size(); }

      private:
        friend class Convolver;
        std::vector<std::vector<std::complex<float>>> parts_;
    };
    static Response prepare(std::size_t blockSize, std::span<const float> response);

    std::size_t blockSize() const;
    /// Empty for silence. Takes effect with the next block.
    void setResponse(std::span<const float> response);
    /// Precondition: prepared for blocks of this size.
    void setResponse(const Response& response);
    void setResponse(Response&& response);
    /// Forgets what it heard and which response it had, as if it were new, and keeps its memory: where responses are
    /// short, one that follows needs no other.
    void restart();
    /// Adds to `output`; both of blockSize() samples.
    void process(std::span<const float> input, std::span<float> output);

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace rtsg
