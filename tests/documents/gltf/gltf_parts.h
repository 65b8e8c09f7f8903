// A glTF file that tests put together piece by piece.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/web_address.h>

#include "documents/import/imported.h"
#include "gltf/gltf_file.h"

namespace rtsg::test {

/// A glTF file that is put together piece by piece.
class GltfParts {
  public:
    template <class T>
    int accessor(int componentType, const char* type, std::size_t components, const std::vector<T>& values) {
        const std::size_t offset = buffer_.size();
        for (const T value : values) put(buffer_, value);
        while (buffer_.size() % 4 != 0) buffer_ += '\0';
        views_ += fmt::format("{}{{\"buffer\":0,\"byteOffset\":{},\"byteLength\":{}}}", count_ ? "," : "", offset,
                              values.size() * sizeof(T));
        accessors_ += fmt::format("{}{{\"bufferView\":{},\"componentType\":{},\"count\":{},\"type\":\"{}\"}}",
                                  count_ ? "," : "", count_, componentType, values.size() / components, type);
        return count_++;
    }
    /// A buffer view of some bytes, with more members; an accessor of the same number stands beside it, which names no
    /// view unless `accessor` says so.
    int view(std::string_view bytes, const std::string& members, const std::string& accessor) {
        const std::size_t offset = buffer_.size();
        buffer_ += bytes;
        while (buffer_.size() % 4 != 0) buffer_ += '\0';
        const char* comma = count_ ? "," : "";
        views_ += fmt::format("{}{{\"buffer\":0,\"byteOffset\":{},\"byteLength\":{}{}}}", comma, offset, bytes.size(),
                              members);
        accessors_ += fmt::format("{}{{{}}}", comma, accessor);
        return count_++;
    }
    std::size_t bytes() const { return buffer_.size(); }
    int floats(const char* type, std::size_t components, const std::vector<float>& values) {
        return accessor(5126, type, components, values);
    }
    std::string text(const std::string& rest) const {
        return fmt::format(
            "{{\"asset\":{{\"version\":\"2.0\"}},\"buffers\":[{{\"byteLength\":{},\"uri\":"
            "\"data:application/octet-stream;base64,{}\"}}],\"bufferViews\":[{}],\"accessors\":[{}],{}}}",
            buffer_.size(), rtsg::base64(std::as_bytes(std::span(buffer_))), views_, accessors_, rest);
    }

  private:
    std::string buffer_, views_, accessors_;
    int count_ = 0;
};

}  // namespace rtsg::test
