// The filter for whatever machine this was built for.
#define MPUCAL_EVALUATE evaluate_portable
#include "filter_impl.hpp"
