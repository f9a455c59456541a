// The hand's filter for the machine that this was built for.
#define MPUCAL_EVALUATE_HAND evaluate_hand_portable
#include "hand_impl.hpp"
