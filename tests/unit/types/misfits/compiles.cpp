// SPDX-License-Identifier: BSD-3-Clause
// Compiled by a test, which expects that it is refused where MISFIT is a struct that does not fit.
#include "misfits.hpp"

using namespace cairn;
using namespace cairn::test::misfits;

template <class T>
int size() {
  if constexpr (FactorTraits<T>)
    return define_factor<T>()->arity();
  else
    return define_variable<T>()->tangent_size();
}

int main() { return size<MISFIT>(); }
