// A parsed glTF 2.0 file: its JSON, its buffers, and the numbers that accessors name.
//
// Invariant: every index and every range is checked; one that does not fit is reported once and gives empty arrays.
// Threading: one thread a file. Source: glTF 2.0 (ISO/IEC 12113:2022) 3.6 (accessors), 4 (GLB);
// KHR_draco_mesh_compression, EXT_meshopt_compression.
#pragma once

#include <cstring>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <vector>

#include <nlohmann/json.hpp>

#include "gltf_unpack.h"
#include "import/import.h"

namespace rtsg::detail {

class GltfFile {
  public:
    GltfFile(const ImportInput& input, Diagnostics& diagnostics) : input_(input), diagnostics_(diagnostics) {}
    /// False if it is no glTF 2.0.
    bool open();

    /// The object `index` of a list of the root; null if there is none, which has been told.
    const nlohmann::json* item(const char* list, std::size_t index);
    const nlohmann::json& root() const { return root_; }
    /// An index or another count of an object; nothing if it is absent or negative.
    static std::optional<std::size_t> index(const nlohmann::json& object, const char* key);
    static double number(const nlohmann::json& object, const char* key, double otherwise);
    static std::string text(const nlohmann::json& object, const char* key);
    static bool flag(const nlohmann::json& object, const char* key);
    /// The numbers of an array of `count`; nothing if it is absent or has another length.
    static std::optional<std::vector<double>> numbers(const nlohmann::json& object, const char* key, std::size_t count);
    /// A member that is an object; an empty one if it is not there.
    static const nlohmann::json& object(const nlohmann::json& object, const char* key);
    static const nlohmann::json& list(const nlohmann::json& object, const char* key);
    /// The object of an extension; an empty one if it is not there.
    static const nlohmann::json& extension(const nlohmann::json& of, const char* name) {
        return object(object(of, "extensions"), name);
    }

    /// All components of an accessor, one after the other; `components` is set to their number in an element.
    /// Normalised integers become fractions; sparse accessors are filled in.
    std::vector<float> floats(std::size_t accessor, std::size_t& components);
    /// The same straight into an array, of an accessor of floats with as many components as `T` has that is not sparse;
    /// nothing for others.
    template <class T>
    std::optional<Array<T>> floatArray(std::size_t accessor);
    Array<std::int32_t> indices(std::size_t accessor);
    std::string_view bufferView(std::size_t index, std::size_t* stride = nullptr);
    /// Each text once. A fault is one of the file; a warning tells of what is not read here.
    void warn(std::string text);
    void fault(std::string text);
    /// Counts what is made of the file beside its bytes; false, and reported once, if it is more than may be. A file
    /// that uses its data again and again would become any size.
    bool mayMake(std::uint64_t bytes);
    /// Light as an UnlitMaterial has it, whose colours are those of a screen (sRGB).
    Vec3f shown(const Vec3f& light) const;
    /// Whether libassimp has written it from a file of another kind. Its extensions, which hang on libassimp's version,
    /// are then not the user's.
    bool isCreatedHere() const { return input_.displayColors; }
    /// What messages call an accessor.
    std::string nameOf(const nlohmann::json& accessor) const;

  private:
    bool openBinary(std::string_view& json);
    bool readExtensions();
    bool lists(const char* key, std::string_view extension) const;
    template <class Function>
    bool loadModule(std::string_view text, std::initializer_list<std::string_view> extensions,
                    Result<Function> (*module)(), Function& into);
    void findPacked();
    /// The accessor of that number, unpacked if Draco has packed it; null if there is none.
    const nlohmann::json* accessorOf(std::size_t number);
    void unpackMesh(nlohmann::json& primitive);
    const std::string& unpackView(std::size_t number, const nlohmann::json& packed);
    std::string extensions(const char* key, const std::function<bool(std::string_view)>& isLeftOut) const;
    std::string_view buffer(std::size_t index);
    void makeFinite(std::vector<float>& numbers);
    struct Elements {
        const char* first;
        std::size_t count, stride, size;  // size: of one, bytes
        std::size_t type;
        bool normalized;
    };
    std::optional<Elements> elementsOf(const nlohmann::json& accessor, std::size_t components);
    /// Elements that can be copied unchanged, since they have the number and the type of components that are wanted;
    /// nothing if they do not.
    struct Plain {
        const char* first;
        std::size_t count, stride;
    };
    std::optional<Plain> plain(const nlohmann::json& accessor, std::size_t components, std::size_t type);
    template <class T, class To>
    bool copyAll(const nlohmann::json& accessor, std::size_t components, std::size_t type, To& into);
    template <class Take>
    bool forEach(const nlohmann::json& accessor, std::size_t components, const Take& take);
    bool mayTakeZeros(const nlohmann::json& accessor, std::size_t count, std::size_t components);
    bool sparse(const nlohmann::json& accessor, std::size_t components, std::vector<float>& into);

    const ImportInput& input_;
    Diagnostics& diagnostics_;
    nlohmann::json root_;
    std::string_view chunk_;  // of a GLB
    std::vector<std::optional<std::string>> buffers_;
    std::size_t zeros_ = 0;                   // floats of sparse accessors that no byte stands for
    std::set<const nlohmann::json*> zeroed_;  // these accessors
    std::set<std::string> reported_;
    std::uint64_t createdHere_ = 0;
    bool isFull_ = false;
    UnpackDraco draco_ = nullptr;  // null: no file that needs it, or no module
    UnpackMeshopt meshopt_ = nullptr;
    std::map<std::size_t, nlohmann::json*> packedBy_;     // accessors that Draco has packed: the primitive of each
    std::map<std::size_t, std::string> unpackedViews_{};  // by number; those behind the file's own are of Draco
};

template <class T>
std::optional<Array<T>> GltfFile::floatArray(std::size_t number) {
    constexpr std::size_t f32 = 5126;
    const nlohmann::json* accessor = accessorOf(number);
    if (!accessor) return {};
    const std::optional<Plain> all = plain(*accessor, sizeof(T) / sizeof(float), f32);
    if (!all) return {};
    Array<T> result;
    result.resize(all->count);
    if (all->count == 0) return result;
    T* const out = result.mutableData();
    if (all->stride == sizeof(T)) {
        std::memcpy(static_cast<void*>(out), all->first, all->count * sizeof(T));
    } else {
        for (std::size_t i = 0; i < all->count; ++i)
            std::memcpy(static_cast<void*>(out + i), all->first + i * all->stride, sizeof(T));
    }
    return result;
}

}  // namespace rtsg::detail
