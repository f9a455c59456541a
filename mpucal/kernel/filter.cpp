// The filter for the machine that this was built for.
#define MPUCAL_EVALUATE evaluate_portable
#include "filter_impl.hpp"
