"""Detection in images with a model of the user's, as ONNX. Loads onnxruntime only when a model is opened."""
