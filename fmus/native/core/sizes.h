/* The largest bodies that a library is compiled for; a component's variables.toml says its own. */
#ifndef VIBROIMPACT_SIZES_H
#define VIBROIMPACT_SIZES_H

#ifndef VI_MODES
#define VI_MODES 64 /* modes of a structure */
#endif
#ifndef VI_PORTS
#define VI_PORTS 8 /* contacts of a structure */
#endif

#endif
