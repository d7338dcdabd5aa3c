"""ROS 2 message types as CDR: schemas, encoders, decoders, topics."""
