// TileLink: the connection between a mirror that draws tiles and the program that joins them.
//
// A message is a line of words, and bytes after it where the line begins with "tile" and ends with their number. A
// mirror says   hello VERSION WIDTH HEIGHT PICTURES_A_SECOND LOOKS   have K SINCE [STATE HASH]   gone K X Y   tile K X
// Y STATE HASH TIME BYTES and is told   draw K X Y COLUMNS ROWS   refused WHY.   K numbers pictures by scene time:
// picture K shows the first state at K over the pictures a second, or later; from picture SINCE on all look alike.
// Threading: one thread.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/core/descriptor.h>
#include <rtsg/core/diagnostic.h>

namespace rtsg {

class TileLink {
  public:
    /// Connects to "tcp://HOST:PORT".
    static Result<TileLink> connect(const std::string& address);
    /// A connection that was accepted.
    explicit TileLink(int descriptor);

    struct Message {
        std::vector<std::string> words;  // at least one
        std::string bytes;
        /// The number that a word is; 0 for what is none.
        std::uint64_t number(std::size_t word) const;
    };

    /// Sends what it can at once; flush() sends the rest.
    void send(std::string_view line, std::string_view bytes = {});
    bool waitsToSend() const { return sent_ < out_.size(); }
    void flush();
    /// Reads what has come. Call receive() until it has no more.
    void read();
    std::optional<Message> receive();
    /// Empty while it is open. The other side has gone, or sent what is no message.
    const std::string& over() const { return over_; }
    int descriptor() const { return descriptor_.get(); }

  private:
    Descriptor descriptor_;
    std::string in_, out_, over_;
    std::size_t sent_ = 0, taken_ = 0;
};

/// Where tile links come in.
class TileDoor {
  public:
    /// Errors: what the system says; an address that others reach, unless `insecure`.
    static Result<TileDoor> open(const std::string& address, bool insecure);
    std::optional<TileLink> accept();
    int descriptor() const { return descriptor_.get(); }
    /// With the real port.
    const std::string& address() const { return address_; }

  private:
    TileDoor(int descriptor, std::string address) : descriptor_(descriptor), address_(std::move(address)) {}
    Descriptor descriptor_;
    std::string address_;
};

}  // namespace rtsg
