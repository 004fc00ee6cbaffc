// The registered models as types, for tests that instantiate their texts on a scalar of their own.
#pragma once

#include <gtest/gtest.h>

#include <string>

// Written by CMake from models/list.def: one #include per header.
#include "all_models.h"

namespace lobefit {

template <class, class... M>
struct TypesAfterFirst {
  using Types = ::testing::Types<M...>;
};

#define LOBEFIT_MODEL(Type, header) , Type
using AllModels = TypesAfterFirst<void
#include "models/list.def"
                                  >::Types;
#undef LOBEFIT_MODEL

/// Names typed tests after their model.
struct ModelTypeName {
  template <class M>
  static std::string GetName(int) {
    return std::string(M::info.name);
  }
};

}  // namespace lobefit
