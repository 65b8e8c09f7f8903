// TileAssembler: joins tiles that many mirrors draw of the same states of a served scene.
//
// A picture is asked for once all mirrors have its state, of two or three at a time, each tile of whoever has nothing
// to do. Tiles of a mirror that goes, or that is late, are given to another. Nothing is drawn while nothing changes.
// Invariant: all tiles of a picture are of one state, by its number and hash; a mirror that has other states than those
// before it is refused. Threading: one thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <list>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <rtsg/renderers/picture_tiles.h>
#include <rtsg/session/tile_link.h>

namespace rtsg {

class TileAssembler {
  public:
    using Clock = std::chrono::steady_clock;

    struct Joined {
        std::uint64_t number = 0;    // by scene time
        std::uint64_t sequence = 0;  // of the state
        double time = 0;             // its scene time
        int width = 0, height = 0;
        std::string pixels;  // RGBA, 8 bits, rows from the top
        double seconds = 0;  // from the first mirror's having the state to the last tile
    };
    struct Counts {
        std::uint64_t pictures = 0, tiles = 0, bytes = 0;
        std::uint64_t again = 0;  // tiles that were asked of another mirror
        std::uint64_t given = 0;  // pictures that were given up, since nobody had the state any longer
        std::size_t mirrors = 0, maxMirrors = 0;
        /// The last picture whose state a mirror has. If none is in work, it looks as the last one that was joined.
        std::uint64_t newest = 0;
    };

    TileAssembler(TileDoor door, int columns, int rows) : door_(std::move(door)), columns_(columns), rows_(rows) {}

    const std::string& address() const { return door_.address(); }
    /// Waits for so long at most: until mirrors say something, or a tile is late. Returns a picture that is whole, in
    /// order.
    std::optional<Joined> poll(std::chrono::milliseconds maximum);
    double picturesPerSecond() const { return picturesPerSecond_; }
    const Counts& counts() const { return counts_; }
    /// What mirrors did wrong since the last call.
    std::vector<std::string> takeProblems() { return std::exchange(problems_, {}); }

  private:
    struct Mirror {
        explicit Mirror(TileLink l) : link(std::move(l)) {}
        TileLink link;
        std::uint64_t order = 0;  // in which they came
        bool known = false;
        std::uint64_t have = 0;
        std::uint64_t since = 0;       // the first of the pictures that look as the last one
        int asked = 0;                 // tiles that it owes
        std::set<std::uint64_t> lost;  // pictures whose states it no longer has
    };
    struct Tile {
        PictureTile area;
        PixelRegion region;
        bool done = false;
        std::vector<const Mirror*> of;  // who was asked
        Clock::time_point since;
    };
    struct Work {
        std::uint64_t number = 0, sequence = 0;
        double time = 0;
        std::string hash;
        std::vector<Tile> tiles;
        std::size_t left = 0;
        Joined joined;
        Clock::time_point begun;
    };

    void hear(Mirror& mirror);
    void take(Mirror& mirror, const TileLink::Message& message);
    void greet(Mirror& mirror, const TileLink::Message& hello);
    void takeTile(Mirror& mirror, const TileLink::Message& message);
    void refuse(Mirror& mirror, const std::string& why);
    void compareStates(Mirror& mirror, const TileLink::Message& have);
    void forget(const Mirror& mirror);
    bool begin();
    void ask();
    Tile* next(const Mirror& mirror, std::uint64_t& number);
    void giveUp();
    Clock::duration patience() const;

    TileDoor door_;
    const int columns_, rows_;
    int width_ = 0, height_ = 0;
    double picturesPerSecond_ = 0;
    std::string looks_;
    std::list<Mirror> mirrors_;
    std::uint64_t came_ = 0;
    /// What a mirror said first of the state of a picture, of the last ones.
    struct Said {
        std::string state;
        std::uint64_t order = 0;  // of the mirror
    };
    std::map<std::uint64_t, Said> states_;
    std::deque<Work> work_;  // by number
    std::uint64_t last_ = 0;
    bool anew_ = false;                                    // what was begun last may not show what is there
    Clock::time_point lateAt_ = Clock::time_point::max();  // when a tile is late that somebody could draw
    double usual_ = 0;                                     // seconds that a tile takes, of late
    Counts counts_;
    std::vector<std::string> problems_;
};

}  // namespace rtsg
