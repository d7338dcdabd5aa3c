"""GoPro HERO8 camera: gpControl over HTTP, preview video as MPEG-TS over UDP."""
