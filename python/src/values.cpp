// Converts between Value and Python's objects.
#include "values.h"

#include <cstring>
#include <limits>
#include <span>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <rtsg/core/custom_field.h>
#include <rtsg/core/field_text.h>

#include "errors.h"

namespace py = pybind11;

namespace rtsg::python {

namespace {

using Header = rtsg::detail::ArrayHeader;

const Header* headerOf(const Value& value) {
    return *static_cast<const Header* const*>(value.storage());
}

void makeReadOnly(const py::array& array) {
    py::detail::array_proxy(array.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
}

/// Over the value's own elements, which it keeps.
py::object viewOf(const Value& value) {
    const Header* const header = headerOf(value);
    std::vector<py::ssize_t> shape = dimensions(value.type());
    const auto count = static_cast<py::ssize_t>(header ? header->size : 0);
    shape.insert(shape.begin(), count);
    const py::dtype type = *numberType(value.type());
    if (!header) return py::array(type, shape);
    const py::capsule owner(new Value(value), [](void* kept) { delete static_cast<Value*>(kept); });
    py::array array(type, shape, header + 1, owner);
    makeReadOnly(array);
    return array;
}

py::object copyOf(const Value& value) {
    py::array array(*numberType(value.type()), dimensions(value.type()), value.storage());
    makeReadOnly(array);
    return array;
}

/// Height x width x components, the top row first.
py::object pictureOf(const Image& image) {
    const py::ssize_t width = image.width(), height = image.height(), components = image.components();
    py::array_t<std::uint8_t> array({height, width, components});
    auto at = array.mutable_unchecked<3>();
    const std::int32_t* word = image.words.data() + 3;
    const bool whole = image.words.size() >= 3 + static_cast<std::size_t>(width * height);
    for (py::ssize_t y = height; y-- > 0;)
        for (py::ssize_t x = 0; x < width; ++x) {
            const auto pixel = whole ? static_cast<std::uint32_t>(*word++) : 0u;
            for (py::ssize_t c = 0; c < components; ++c)
                at(y, x, c) = static_cast<std::uint8_t>(pixel >> (8 * (components - 1 - c)));
        }
    makeReadOnly(array);
    return array;
}

py::object textOf(const String& text) {
    const std::string_view view = text.view();
    return py::reinterpret_steal<py::object>(
        PyUnicode_DecodeUTF8(view.data(), static_cast<py::ssize_t>(view.size()), "replace"));
}

template <class T, class Make>
py::tuple tupleOf(const Value& value, Make make) {
    const Array<T>& elements = value.as<Array<T>>();
    py::tuple result(elements.size());
    for (std::size_t i = 0; i < elements.size(); ++i) result[i] = make(elements[i]);
    return result;
}

/// A number, an array of them, or bytes.
py::object customOf(const CustomValue& value) {
    const auto type = CustomType::of(value);
    const std::span<const std::byte> bits = customBits(value);
    const auto* const first = reinterpret_cast<const char*>(bits.data());
    if (!type || type->layout().of == CustomLayout::Of::bytes) return py::bytes(first, bits.size());
    const auto created = [&]<class S>(S) -> py::object {
        py::array_t<S> array(static_cast<py::ssize_t>(bits.size() / sizeof(S)));
        std::memcpy(array.mutable_data(), first, bits.size());
        if (type->layout().count == 1) return py::cast(array.data()[0]);
        makeReadOnly(array);
        return array;
    };
    if (type->layout().of == CustomLayout::Of::int32) return created(std::int32_t());
    return type->layout().of == CustomLayout::Of::float32 ? created(float()) : created(double());
}

}  // namespace

// ---- to Python -----------------------------------------------------------------------------------------------------

std::optional<py::dtype> numberType(FieldType type) {
    switch (sf(type)) {
        case FieldType::SFBool:
            return py::dtype::of<bool>();
        case FieldType::SFInt32:
            return py::dtype::of<std::int32_t>();
        case FieldType::SFString:
        case FieldType::SFNode:
        case FieldType::SFImage:
        case FieldType::SFCustom:
            return std::nullopt;
        default: {
            const FieldTypeInfo& i = info(sf(type));
            return i.elementSize == 4 * i.components ? py::dtype::of<float>() : py::dtype::of<double>();
        }
    }
}

std::vector<py::ssize_t> dimensions(FieldType type) {
    const int components = info(type).components;
    switch (sf(type)) {
        case FieldType::SFMatrix3f:
        case FieldType::SFMatrix3d:
            return {3, 3};
        case FieldType::SFMatrix4f:
        case FieldType::SFMatrix4d:
            return {4, 4};
        default:
            return components > 1 ? std::vector<py::ssize_t>{components} : std::vector<py::ssize_t>{};
    }
}

const Node& NodeObject::node() const {
    const Node* const found = handle->scene().find(id);
    if (!found) raise(DiagnosticCode("no-such-node"), fmt::format("node #{} is gone", id.value), "NoSuchName");
    return *found;
}

py::object nodeOrNone(const py::object& scene, NodeId id) {
    if (!id) return py::none();
    return py::cast(NodeObject{scene, py::cast<SceneHandle*>(scene), id});
}

py::object toPython(const Value& value, const py::object& scene) {
    switch (value.type()) {
        case FieldType::SFBool:
            return py::bool_(value.as<bool>());
        case FieldType::SFInt32:
            return py::int_(value.as<std::int32_t>());
        case FieldType::SFFloat:
            return py::float_(value.as<float>());
        case FieldType::SFDouble:
            return py::float_(value.as<double>());
        case FieldType::SFTime:
            return py::float_(value.as<Time>().seconds);
        case FieldType::SFString:
            return textOf(value.as<String>());
        case FieldType::SFNode:
            return nodeOrNone(scene, value.as<NodeId>());
        case FieldType::SFImage:
            return pictureOf(value.as<Image>());
        case FieldType::SFCustom:
            return customOf(value.as<CustomValue>());
        case FieldType::MFCustom:
            return tupleOf<CustomValue>(value, customOf);
        case FieldType::MFString:
            return tupleOf<String>(value, textOf);
        case FieldType::MFNode:
            return tupleOf<NodeId>(value, [&](NodeId id) { return nodeOrNone(scene, id); });
        case FieldType::MFImage:
            return tupleOf<Image>(value, pictureOf);
        default:
            return isMF(value.type()) ? viewOf(value) : copyOf(value);
    }
}

// ---- from Python ---------------------------------------------------------------------------------------------------

namespace {

[[noreturn]] void refuse(FieldType type, std::string_view what, std::string_view why) {
    throw py::type_error(fmt::format("{} is {}: {}", what, info(type).name, why));
}

/// Whether NumPy's numbers of this kind can be converted to the type without loss.
bool suits(FieldType type, char kind) {
    switch (sf(type)) {
        case FieldType::SFBool:
            return kind == 'b' || kind == 'i' || kind == 'u';  // 0 and 1 alone: checkRange()
        case FieldType::SFInt32:
            return kind == 'i' || kind == 'u';
        default:
            return kind == 'f' || kind == 'i' || kind == 'u' || kind == 'b';
    }
}

void checkRange(FieldType type, const py::array& array, std::string_view what) {
    if (sf(type) == FieldType::SFBool && array.size() > 0 && array.dtype().kind() != 'b') {
        if (py::cast<bool>(array.attr("max")().attr("__gt__")(1)) ||
            py::cast<bool>(array.attr("min")().attr("__lt__")(0)))
            throw py::value_error(fmt::format("{} is {}: expected True or False, or 1 or 0", what, info(type).name));
    }
    if (sf(type) != FieldType::SFInt32 || array.size() == 0 || array.itemsize() < 4) return;
    const auto minimum = array.attr("min")(), maximum = array.attr("max")();
    if (py::cast<bool>(maximum.attr("__gt__")(std::numeric_limits<std::int32_t>::max())) ||
        py::cast<bool>(minimum.attr("__lt__")(std::numeric_limits<std::int32_t>::min())))
        throw py::value_error(fmt::format("{} is {}: a number does not fit into 32 bits", what, info(type).name));
}

/// Null if it is nothing of which NumPy makes an array. What its functions raise otherwise, Ctrl-C say, is raised.
py::array arrayFrom(const py::handle& object) {
    try {
        return py::array(py::reinterpret_borrow<py::object>(object));
    } catch (py::error_already_set& error) {
        if (!error.matches(PyExc_TypeError) && !error.matches(PyExc_ValueError)) throw;
        return py::reinterpret_steal<py::array>(py::handle());
    }
}

template <class T>
Value arrayValue(const Numbers& numbers) {
    return Value(Array<T>(std::span<const T>(static_cast<const T*>(numbers.array.data()), numbers.count)));
}

Value manyFrom(FieldType type, const Numbers& numbers) {
    switch (type) {
#define RTSG_X(suffix, element)                                                                  \
    case FieldType::MF##suffix:                                                                  \
        if constexpr (std::is_trivially_copyable_v<element> && !std::is_same_v<element, NodeId>) \
            return arrayValue<element>(numbers);                                                 \
        break;
        RTSG_FIELD_TYPES(RTSG_X)
#undef RTSG_X
        default:
            break;
    }
    return {};
}

String stringFrom(FieldType type, const py::handle& object, std::string_view what) {
    if (!PyUnicode_Check(object.ptr())) refuse(type, what, "expected str");
    py::ssize_t size = 0;
    const char* const text = PyUnicode_AsUTF8AndSize(object.ptr(), &size);
    if (!text) throw py::error_already_set();
    return String(std::string_view(text, static_cast<std::size_t>(size)));
}

NodeId nodeFrom(FieldType type, const py::handle& object, const SceneHandle& handle, std::string_view what) {
    if (object.is_none()) return {};
    if (!py::isinstance<NodeObject>(object)) refuse(type, what, "expected a Node or None");
    const auto& node = py::cast<const NodeObject&>(object);
    if (node.handle != &handle) throw py::value_error(fmt::format("{}: the node is of another scene", what));
    return node.id;
}

Image imageFrom(const py::handle& object, std::string_view what) {
    py::array array = arrayFrom(object);
    if (!array || (array.ndim() != 2 && array.ndim() != 3) || array.dtype().kind() != 'u' || array.itemsize() != 1)
        refuse(FieldType::SFImage, what, "expected bytes (uint8), height x width x components, the top row first");
    array = py::array_t < std::uint8_t, py::array::c_style | py::array::forcecast > (array);
    const py::ssize_t height = array.shape(0), width = array.shape(1),
                      components = array.ndim() == 3 ? array.shape(2) : 1;
    if (components < 1 || components > 4) refuse(FieldType::SFImage, what, "a pixel has 1 to 4 components");
    Image image;
    image.words = Array<std::int32_t>::ofSize(static_cast<std::size_t>(3 + width * height));
    std::int32_t* word = image.words.mutableData();
    for (const py::ssize_t number : {width, height, components}) *word++ = static_cast<std::int32_t>(number);
    const auto* bytes = static_cast<const std::uint8_t*>(array.data());
    for (py::ssize_t y = height; y-- > 0;)
        for (py::ssize_t x = 0; x < width; ++x) {
            std::uint32_t pixel = 0;
            for (py::ssize_t c = 0; c < components; ++c) pixel = pixel << 8 | bytes[(y * width + x) * components + c];
            *word++ = static_cast<std::int32_t>(pixel);
        }
    return image;
}

template <class T, class Make>
Value listFrom(FieldType type, const py::handle& object, std::string_view what, Make make) {
    if (PyUnicode_Check(object.ptr()) || !py::isinstance<py::iterable>(object))
        refuse(type, what, "expected a list or another sequence");
    Array<T> elements;
    for (const py::handle element : py::reinterpret_borrow<py::iterable>(object)) elements.push_back(make(element));
    return Value(std::move(elements));
}

/// From a text, bytes, a number or several.
CustomValue customFrom(const CustomType& type, const py::handle& object, std::string_view what) {
    Result<CustomValue> created;
    if (PyUnicode_Check(object.ptr())) {
        auto parsed = parseFieldText(FieldType::SFCustom, py::cast<std::string>(object), TextSyntax::xml, &type);
        if (!parsed) throw py::value_error(fmt::format("{} is SF{}: {}", what, type.name(), parsed.error().text));
        return parsed->as<CustomValue>();
    }
    if (PyBytes_Check(object.ptr())) {
        if (type.layout().of != CustomLayout::Of::bytes)
            throw py::type_error(fmt::format("{} is SF{}: expected numbers, not bytes", what, type.name()));
        const auto bytes = py::cast<std::string>(object);
        created = type.value(std::as_bytes(std::span(bytes)));
    } else {
        const py::array given = arrayFrom(object);
        const auto numbers = py::array_t < double, py::array::c_style | py::array::forcecast > ::ensure(given);
        if (!numbers) {
            PyErr_Clear();
            throw py::type_error(fmt::format("{} is SF{}: expected numbers, a text or bytes", what, type.name()));
        }
        created = type.value(std::span(numbers.data(), static_cast<std::size_t>(numbers.size())));
    }
    if (created) created = normalisedCustom(type, std::move(*created));
    if (!created) throw py::value_error(fmt::format("{}: {}", what, created.error().text));
    return std::move(*created);
}

Value builtinFrom(FieldType type, const py::handle& object, const SceneHandle& handle, std::string_view what);

}  // namespace

Value fromPython(const FieldDef& field, const py::handle& object, const SceneHandle& handle, std::string_view what) {
    const SceneHandle::Within within(handle);  // arrays, sequences and numbers have functions of Python
    if (!field.custom) return builtinFrom(field.type, object, handle, what);
    if (!isMF(field.type)) return Value(customFrom(*field.custom, object, what));
    return listFrom<CustomValue>(field.type, object, what,
                                 [&](py::handle one) { return customFrom(*field.custom, one, what); });
}

std::string textFrom(const py::handle& object, std::string_view what) {
    if (!PyUnicode_Check(object.ptr())) throw py::type_error(fmt::format("{}: expected str", what));
    return py::cast<std::string>(object);
}

Numbers numbersFrom(FieldType type, const py::handle& object, std::string_view what) {
    py::array array = arrayFrom(object);
    if (!array) refuse(type, what, "expected numbers");
    const bool isEmpty = array.size() == 0;
    const char kind = array.dtype().kind();
    if (!isEmpty && !suits(type, kind))
        refuse(type, what,
               kind == 'O' || kind == 'U' || kind == 'S'
                   ? "expected numbers, as many in each row"
                   : fmt::format("numbers of NumPy's kind '{}' do not suit", kind));
    checkRange(type, array, what);
    const std::vector<py::ssize_t> one = dimensions(type);
    std::vector<py::ssize_t> shape(array.shape(), array.shape() + array.ndim());
    const std::size_t leading = isMF(type) ? 1 : 0;
    const bool fits = shape.size() == one.size() + leading &&
                      std::equal(one.begin(), one.end(), shape.begin() + static_cast<std::ptrdiff_t>(leading));
    if (!fits && !(isEmpty && isMF(type)))
        throw py::value_error(fmt::format("{} is {}: expected the shape ({}{}), not ({})", what, info(type).name,
                                          leading ? "n, " : "", fmt::join(one, ", "), fmt::join(shape, ", ")));
    const std::size_t count = leading ? (isEmpty ? 0 : static_cast<std::size_t>(shape[0])) : 1;
    const py::dtype wanted = *numberType(type);
    constexpr int kFlags = py::array::c_style | py::array::forcecast;
    switch (wanted.char_()) {
        case '?':
            return {py::array_t<bool, kFlags>(array), count};
        case 'f':
            return {py::array_t<float, kFlags>(array), count};
        case 'd':
            return {py::array_t<double, kFlags>(array), count};
        default:
            return {py::array_t<std::int32_t, kFlags>(array), count};
    }
}

namespace {

Value builtinFrom(FieldType type, const py::handle& object, const SceneHandle& handle, std::string_view what) {
    switch (type) {
        case FieldType::SFString:
            return Value(stringFrom(type, object, what));
        case FieldType::SFNode:
            return Value(nodeFrom(type, object, handle, what));
        case FieldType::SFImage:
            return Value(imageFrom(object, what));
        case FieldType::MFString:
            return listFrom<String>(type, object, what, [&](py::handle one) { return stringFrom(type, one, what); });
        case FieldType::MFNode:
            return listFrom<NodeId>(type, object, what,
                                    [&](py::handle one) { return nodeFrom(type, one, handle, what); });
        case FieldType::MFImage:
            return listFrom<Image>(type, object, what, [&](py::handle one) { return imageFrom(one, what); });
        case FieldType::SFFloat:
            if (PyFloat_CheckExact(object.ptr())) return Value(static_cast<float>(PyFloat_AS_DOUBLE(object.ptr())));
            break;
        case FieldType::SFBool:
            if (PyBool_Check(object.ptr())) return Value(object.ptr() == Py_True);
            break;
        default:
            break;
    }
    const Numbers numbers = numbersFrom(type, object, what);
    return isMF(type) ? manyFrom(type, numbers) : Value::fromStorage(type, numbers.array.data());
}

}  // namespace

}  // namespace rtsg::python
