// The hand's filter for whatever machine this was built for.
#define MPUCAL_EVALUATE_HAND evaluate_hand_portable
#include "hand_impl.hpp"
