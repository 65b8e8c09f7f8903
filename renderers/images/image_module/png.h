// Finds damage in PNG files before libpng does, because libpng writes its findings to the terminal.
//
// Only chunks that pixels come from are looked at, and a lost end behind them is forgiven. Threading: any thread.
// Source: W3C, Portable Network Graphics (third edition), 5.2 and 5.3 (signature, chunks), 13.2 (errors).
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>

namespace rtsg {

/// Whether these first bytes are those of a PNG file.
bool isPng(std::span<const std::uint8_t> bytes);

/// Describes damage in the chunks that pixels are read from, with the byte where it is, or in the pixels themselves;
/// empty if there is none. `check` is ReadRequest's, and is asked before pixels are looked at.
std::string damageOfPng(std::span<const std::uint8_t> file,
                        const std::function<std::string(int width, int height, int layers, bool eightBits)>& check);

}  // namespace rtsg
