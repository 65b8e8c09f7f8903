// Units of documents: UNIT statements give the units of lengths, angles, masses and forces in a document. Readers
// convert values to metres, radians, kilograms and newtons, and writers convert them back to the document's units.
//
// Invariant: a value that was read and is written in the same units has the digits it had. Fields of prototypes and
// Scripts have no unit; which field of a node counts in what is in the node tables. Threading: one thread an object.
// Source: ISO/IEC 19775-1 V4.0 4.3.6 (categories, and what is derived from them), 7.2.5.6 (UNIT).
#pragma once

#include <string_view>

#include <rtsg/core/node_type.h>

namespace rtsg::detail {

class Units {
  public:
    /// Takes a UNIT statement; unknown categories change nothing.
    void set(std::string_view category, double factor);
    /// Are all of them the standard's own?
    bool areStandard() const { return length_ == 1 && angle_ == 1 && mass_ == 1 && force_ == 1; }
    /// From the document's units to the standard's, in place. `field` is null for a field that no table has,
    /// as of a PROTO or a Script: only rotations are then known to have a unit.
    void toStandard(const FieldDef* field, Value& value) const;
    /// The other way: the shortest decimals that toStandard() turns into this very value.
    void fromStandard(const FieldDef* field, Value& value) const;

  private:
    double factor(Unit unit) const;
    double factorOf(const FieldDef* field, const Value& value) const;
    double length_ = 1, angle_ = 1, mass_ = 1, force_ = 1;
};

}  // namespace rtsg::detail
